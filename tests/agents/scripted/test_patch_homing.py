"""The agent that drives home over the patch of its map."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_agents.agent import EnvironmentConfigs, begin_episode
from albot_agents.registry import make_agent
from albot_agents.scripted.patch_homing import PatchHoming, shortest_path
from albot_core.errors import InputError
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import DEFAULT_PARTS, ObservationConfig
from albot_env.tasks.core.parts.map_patch import MapPatchConfig
from albot_env.tasks.homing_by_map.changes import ChangesConfig
from albot_env.tasks.homing_by_map.task import HomingByMapConfig

UNCHANGED = ChangesConfig(door_shut=0.0, door_opened=0.0, carried=0.0, furniture_moved=0.0)


def test_the_cheapest_way_leads_round_what_is_dear() -> None:
    costs = np.ones((9, 9))
    costs[2, 1:8] = 100.0
    way = shortest_path(costs, (0, 4))
    assert way is not None
    assert way[0].tolist() == [4, 4]
    assert way[-1].tolist() == [0, 4]
    assert 2 in way[:, 0]
    crossed = way[way[:, 0] == 2][0]
    assert crossed[1] in (0, 8)
    assert (np.abs(np.diff(way, axis=0)).max(axis=1) == 1).all()
    straight = shortest_path(np.ones((9, 9)), (0, 0))
    assert straight is not None
    assert straight.tolist() == [[4 - k, 4 - k] for k in range(5)]


@pytest.mark.parametrize("mapper", ["albot1", "gmapping"])
def test_it_comes_home_without_hints(mapper: str) -> None:
    config = HomingByMapConfig(changes=UNCHANGED)
    settings: dict[str, Any] = {"world": "random:office:9?rooms=5", "config": config}
    env = gymnasium.make("Albot/HomingByMap-v0", mapper=mapper, **settings)
    agent = make_agent("patch-homing", EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 5)
    begin, is_over = info["distance_home"], False
    while not is_over:
        observation, _, terminated, truncated, info = env.step(agent.act(observation, {}))
        is_over = terminated or truncated
    assert begin > 3.0
    assert info["is_success"], info["distance_home"]
    assert info["spl"] > 0.6


def test_it_needs_the_patch_and_its_trail() -> None:
    with pytest.raises(InputError, match=r"patch-homing: expected .*map_patch"):
        PatchHoming(EnvironmentConfigs(ObservationConfig(), ActionConfig()))
    shown = ObservationConfig(
        parts=(*DEFAULT_PARTS, "map_patch"), map_patch=MapPatchConfig(channels=("walls", "home"))
    )
    with pytest.raises(InputError, match=r"with the channel trail, found walls, home"):
        PatchHoming(EnvironmentConfigs(shown, ActionConfig()))


def test_its_way_leads_round_what_the_laser_saw_lately() -> None:
    shown = ObservationConfig(
        parts=(*DEFAULT_PARTS, "map_patch"),
        map_patch=MapPatchConfig(sides=(8.0,), cells=16, channels=("trail", "home", "obstacles")),
    )
    agent = PatchHoming(EnvironmentConfigs(shown, ActionConfig()))
    agent.reset(np.random.default_rng(0), ActionConfig().space)
    patch = np.full((3, 16, 16), -1.0, np.float32)
    patch[0, :9, 8] = 1.0  # The trail leads straight ahead, to home.
    patch[1, 1, 8] = 1.0
    observation = {"map_patch": patch, "home": np.array([1.0, 0.0, -1.0 / 3], np.float32)}
    known = agent._search(observation, np.zeros(3))
    assert known is not None
    assert known.ahead[1] == pytest.approx(-0.25)
    patch[2, 5, 4:] = 1.0  # Something stands across it, from the left to the edge of the patch.
    led_round = agent._search(observation, np.zeros(3))
    assert led_round is not None
    assert led_round.length > known.length + 1.0
    assert led_round.ahead[1] > 1.0, "to the left"
