"""The agent that drives home over Albot1's network of places."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from albot_agents.agent import choose
from albot_agents.episode import begin_episode
from albot_agents.registry import make_agent
from albot_env.tasks.homing.outward_journey import OutingConfig
from albot_env.tasks.homing.task import HomingConfig
from tests.env.quick import IDS

assert "Albot/Homing-v0" in IDS


def _come_home(world: Any, seed: int, **outing: float) -> dict[str, Any]:
    config = HomingConfig(outing=OutingConfig(**outing))
    env = gymnasium.make("Albot/Homing-v0", world=world, config=config, max_episode_steps=900)
    agent = make_agent("albot1-homing", env.get_wrapper_attr("observing"))
    observation, info = begin_episode(env, agent, seed)
    over = False
    while not over:
        action = choose(agent, observation, info)
        observation, _, ended, cut, info = env.step(action)
        over = ended or cut
    return dict(info)


def test_it_comes_home_from_another_room_without_touching_anything() -> None:
    info = _come_home("random:office:3?rooms=4", 3, shortest=12.0, longest=16.0, away=3.0)
    assert info["is_success"]
    assert info["spl"] > 0.5
    assert not info["collided"]


def test_where_no_way_is_shown_it_makes_straight_for_home() -> None:
    env = gymnasium.make("Albot/Explore-v0", world="square-loop", mapper="odometry")
    agent = make_agent("albot1-homing", env.get_wrapper_attr("observing"))
    observation, info = begin_episode(env, agent, 1)
    assert np.array_equal(choose(agent, observation, info), [0, 0])
