"""Revealed twins: what they show is the truth, and all else is as in the task itself."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from albot_core.errors import InputError
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.truth import REVEALED, TRUE_HOME, TRUE_PATCH
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import World
from tests.env.quick import IDS, JUDGED, SETTINGS, drawn_actions

TWINS = [f"{name[:-3]}Revealed{name[-3:]}" for name in IDS if name not in JUDGED]


def of(twin: str) -> str:
    return twin.replace("Revealed", "")


def test_each_task_in_which_the_agent_drives_has_a_twin() -> None:
    probes = {name for name in gymnasium.registry if name.startswith("Albot/Probe-")}
    twins = {name for name in gymnasium.registry if name[:6] == "Albot/" and "Revealed" in name}
    assert twins - probes == set(TWINS)
    assert {of(twin) for twin in twins & probes} == probes - twins


@pytest.mark.parametrize("twin", TWINS)
def test_a_twin_shows_the_truth_and_is_the_task_otherwise(twin: str) -> None:
    """Alone as in a batch, and branched."""
    settings: dict[str, Any] = {"world": "square-loop", **SETTINGS.get(of(twin), {})}
    settings["mapper"] = "albot1"
    env, plain = gymnasium.make(twin, **settings), gymnasium.make(of(twin), **settings)
    check_env(env.unwrapped, skip_render_check=True)
    batch = gymnasium.make_vec(twin, num_envs=2, **settings)
    seen, info = env.reset(seed=4)
    bare, _ = plain.reset(seed=4)
    rows, _ = batch.reset(seed=[4, 5])
    config = env.get_wrapper_attr("observation_config")
    assert config.parts[-2:] == REVEALED
    rng, state = np.random.default_rng(1), None
    for step in range(25):
        parts, hidden = config.split(seen), plain.get_wrapper_attr("observation_config").split(bare)
        for name, numbers in hidden.items():
            np.testing.assert_array_equal(parts[name], numbers, err_msg=name)
        np.testing.assert_array_equal(rows[0], seen)
        home = config.decode(TRUE_HOME, seen)
        x, y = (info["start"] - info["pose"])[:2]
        turned = math.atan2(y, x) - info["pose"][2]
        away = math.hypot(x, y)
        expected = away * math.cos(turned), away * math.sin(turned)
        assert home == pytest.approx(expected, abs=1e-4)
        if step == 12:
            state = env.unwrapped.get_state()  # type: ignore[attr-defined]
            assert state.environment == batch.get_state(0).environment == twin  # type: ignore[attr-defined]
        action = drawn_actions(of(twin), rng)
        seen, reward, *_, info = env.step(action)
        bare, same, *_ = plain.step(action)
        rows, *_ = batch.step(np.stack((action, action)))
        assert reward == same
    other = gymnasium.make(twin, **settings)
    other.reset(seed=9)
    other.unwrapped.set_state(state)  # type: ignore[attr-defined]
    rng = np.random.default_rng(1)
    actions = [drawn_actions(of(twin), rng) for _ in range(25)]
    for action in actions[12:]:
        again, *_ = other.step(action)
    np.testing.assert_array_equal(again, seen)
    batch.close()


def test_the_true_patch_shows_the_world_around_the_true_pose(two_rooms: World) -> None:
    env = gymnasium.make(
        "Albot/ExploreRevealed-v0", world=two_rooms, mapper="albot1", odometer="poor"
    )
    seen, _ = env.reset(seed=1, options={"start": (2.0, 2.0, math.pi / 2)})
    config = env.get_wrapper_attr("observation_config")
    shown = config.decode(TRUE_PATCH, seen).channels
    walls = np.argwhere(shown["walls"][0] > 0)
    # Looking north from (2, 2): walls 2 m ahead and behind, 2 m to the left, 8 m to the right.
    assert {(12, column) for column in range(12, 28)} <= set(map(tuple, walls.tolist()))
    assert walls[:, 1].min() == 12
    assert {walls[:, 0].min(), walls[:, 0].max()} == {12, 20}
    assert (shown["places"][0] > 0).sum() == 2
    assert np.argwhere(shown["home"][0] > 0).tolist() == [[16, 16]]


def test_the_truth_is_refused_where_it_is_not_to_be_revealed(two_rooms: World) -> None:
    config = ExploreConfig(observations=ObservationConfig(parts=("laser", "true_home")))
    with pytest.raises(InputError, match=r"an environment that reveals it.*found true_home"):
        gymnasium.make("Albot/Explore-v0", world=two_rooms, config=config)
    with pytest.raises(InputError, match="a task in which the agent drives, found reveal=True"):
        gymnasium.make(JUDGED[0], world=two_rooms, reveal=True)
