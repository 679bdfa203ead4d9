"""What each environment of a batch has as its own: `call`, `get_attr` and `set_attr`."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from albot_core.errors import InputError
from tests.env import quick
from tests.env.vector.test_contract import assert_same


def _batch(environment: str = "Albot/Explore-v0", **options: Any) -> Any:
    settings = {"world": quick.LOOP, "mapper": "none", **quick.SETTINGS.get(environment, {})}
    return gymnasium.make_vec(environment, num_envs=3, **(settings | options))


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_it_says_how_it_resets(environment: str, mode: AutoresetMode) -> None:
    envs = _batch(environment, autoreset_mode=mode.value)
    assert envs.autoreset_mode is mode is envs.metadata["autoreset_mode"]
    assert envs.metadata["render_modes"] == ["rgb_array"]


def test_attributes_are_those_of_single_environments() -> None:
    envs, single = _batch(), gymnasium.make("Albot/Explore-v0", world=quick.LOOP, mapper="none")
    assert envs.get_attr("render_mode") == (None, None, None) == envs.call("render")
    for name in ("action_space", "observation_space", "observation_config"):
        assert envs.get_attr(name) == (single.get_wrapper_attr(name),) * 3
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.get_attr("np_random")
    envs.reset(seed=4)
    single.reset(seed=5)
    assert_same(envs.call("get_state")[1].robot.arrays, single.unwrapped.get_state().robot.arrays)


def test_generators_are_set_one_for_each_or_one_for_all() -> None:
    """The next episodes are then drawn by them."""
    envs, other = _batch(world="corridor-loop"), _batch(world="corridor-loop")
    envs.reset(seed=1)
    other.reset(seed=2)
    envs.set_attr("np_random", [np.random.default_rng(k) for k in range(3)])
    other.set_attr("np_random", tuple(np.random.default_rng(k) for k in range(3)))
    assert_same(envs.reset(), other.reset())
    generator = np.random.default_rng(7)
    envs.set_attr("np_random", generator)
    assert envs.get_attr("np_random") == (generator,) * 3
    with pytest.raises(InputError, match="np_random: expected 3 values, one per environment"):
        envs.set_attr("np_random", [generator])


def test_what_they_do_not_have_is_told() -> None:
    envs = _batch()
    with pytest.raises(AttributeError, match=r"no attribute 'rendr' \(did you mean render\?\)"):
        envs.call("rendr")
    with pytest.raises(AttributeError, match="'action_masks'"):
        envs.get_attr("action_masks")
    with pytest.raises(
        AttributeError, match=r"'world' cannot be set .* only agent, np_random, recorder"
    ):
        envs.set_attr("world", "square-loop")
    with pytest.raises(InputError, match="np_random: expected a numpy Generator, found 5"):
        envs.set_attr("np_random", 5)


def test_masks_tell_what_an_observation_shows() -> None:
    """In a batch as in single environments, also at the end."""
    environment = "Albot/PlaceRecognition-v0"
    envs = _batch(environment, observation="dict", autoreset_mode="Disabled")
    single = gymnasium.make(
        environment, mapper="none", observation="dict", **quick.SETTINGS[environment]
    )
    with pytest.raises(gymnasium.error.ResetNeeded):
        single.get_wrapper_attr("action_masks")()
    seen, _ = envs.reset(seed=1)
    single.reset(seed=2)
    for _ in range(quick.GLANCE.tour.arrivals - 1):
        masks = np.array(envs.call("action_masks"))
        assert masks.dtype == np.bool_ and masks[:, 0].all()
        np.testing.assert_array_equal(masks[:, 1:], seen["mask"] > 0)
        np.testing.assert_array_equal(single.get_wrapper_attr("action_masks")(), masks[1])
        seen, _, over, *_ = envs.step(np.zeros(3, np.int64))
        single.step(0)
    assert over.all()
    np.testing.assert_array_equal(envs.unwrapped.action_masks()[:, 1:], seen["mask"] > 0)
