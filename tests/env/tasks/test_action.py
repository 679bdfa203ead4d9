"""Actions by number: what they ask for, and what becomes of those that are none."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import albot_env
from albot_core.errors import InputError
from albot_env.tasks.core.actions import DRIVING, ActionConfig, DeclaringActionConfig
from tests.env.quick import DRIVEN, SETTINGS

assert albot_env.__doc__


def _make(environment: str, action: str = "discrete") -> gymnasium.Env[Any, Any]:
    settings = {"world": "square-loop", "mapper": "none", **SETTINGS.get(environment, {})}
    return gymnasium.make(environment, action=action, **settings)


def test_choices_drive_and_then_declare() -> None:
    choices = DeclaringActionConfig().choices
    assert choices[: len(DRIVING), :2].tolist() == [list(pair) for pair in DRIVING]
    assert not DeclaringActionConfig().flagged(choices[:-1], "declare").any()
    assert choices[-1].tolist() == [0.0, 0.0, 1.0]
    assert ActionConfig().choice_space.n == len(DRIVING)


@pytest.mark.parametrize("threshold", [1.0, -1.1, 7.5, np.nan])
def test_what_no_number_can_say_or_all_must_is_refused(threshold: float) -> None:
    with pytest.raises(InputError, match="threshold: expected a number from -1, below 1, found"):
        DeclaringActionConfig(threshold=threshold)


@pytest.mark.parametrize("environment", DRIVEN)
def test_a_choice_does_what_its_numbers_do(environment: str) -> None:
    by_number, by_numbers = _make(environment), _make(environment, "continuous")
    check_env(by_number.unwrapped, skip_render_check=True)
    choices = by_number.unwrapped._robot.actions.choices
    by_number.reset(seed=4)
    by_numbers.reset(seed=4)
    for choice in (0, 4, 9, 1, 7, 2):
        one = by_number.step(choice)
        other = by_numbers.step(choices[choice].astype(np.float32))
        np.testing.assert_allclose(one[0], other[0], atol=1e-6)
        assert one[1] == pytest.approx(other[1], abs=1e-6)


@pytest.mark.parametrize("action", [-1, 99, 1.0, np.array([1, 2]), np.nan, "left", None])
def test_what_is_no_choice_is_refused(action: Any) -> None:
    env = _make("Albot/Explore-v0")
    env.reset(seed=1)
    with pytest.raises(InputError, match="whole number from 0 to"):
        env.unwrapped.step(action)


def test_a_batch_chooses_too_and_names_who_is_wrong() -> None:
    batch = gymnasium.make_vec(
        "Albot/Explore-v0", 3, world="square-loop", mapper="none", action="discrete"
    )
    batch.reset(seed=[7, 7, 7])
    observations, *_ = batch.step(np.array([0, 0, 6]))
    assert (observations[0] != observations[2]).any()
    single = _make("Albot/Explore-v0")
    single.reset(seed=7)
    np.testing.assert_array_equal(single.step(6)[0], observations[2])
    with pytest.raises(InputError, match="environment 1: expected a whole number"):
        batch.step(np.array([0, 50, 1]))
    with pytest.raises(InputError, match="for each of 3"):
        batch.step(np.array([0, 1]))
    with pytest.raises(InputError, match="continuous or discrete"):
        gymnasium.make("Albot/Explore-v0", action="both")


def test_discrete_actions_are_within_limits_and_to_either_side_alike() -> None:
    choices = np.array(DRIVING)
    assert np.abs(choices).max() == 1.0
    mirrored = choices * (1.0, -1.0)
    assert sorted(map(tuple, mirrored)) == sorted(map(tuple, choices))
