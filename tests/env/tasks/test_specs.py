"""Settings as plain data: an environment's spec as JSON text, from which it is made again."""

from __future__ import annotations

import dataclasses
import json
import math
import pickle
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec, load_env_creator
from gymnasium.vector import AutoresetMode
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import albot_maps
from albot_core.errors import InputError
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.plain_data import to_plain
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.settings import UnknownSettingError, chosen_config, config_class
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import WorldSet
from tests.env import quick
from tests.env.vector.test_contract import assert_same

WORLD = Path(albot_maps.__file__).parent / "catalogue" / "square-loop.yaml"
FACTORS = (1.25, 0.8, 1.01, 0.99, 2.0)
INSTEAD_OF_NONE = {
    "channels": ("walls", "home"),
    "laser_sectors": 7,
    "observations": ObservationConfig(parts=("motion", "laser"), laser_range=4.0),
}
"""Values of the fields that are None by default, by their names."""


def _config(environment: str) -> Any:
    made: Any = load_env_creator(gymnasium.registry[environment].entry_point)
    return config_class(made.task)()


def _other_values(value: Any) -> Iterator[Any]:
    """Yield values of the same type that a field might have instead."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from (value + 1, value - 1)
    elif isinstance(value, float):
        yield from (value * factor for factor in FACTORS)
        yield from (0.5, 2.0, math.inf)
    elif isinstance(value, tuple) and value:
        if isinstance(value[0], str):
            yield value[1:]
        else:
            yield tuple(
                each + 0.01 if isinstance(each, float) else next(_other_values(each))
                for each in value
            )
    elif isinstance(value, tuple):
        yield ("west", "east", "west")


def _changed(config: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the configurations that differ in one field, at any depth, each with its path."""
    for field in dataclasses.fields(config):
        value, place = getattr(config, field.name), (*path, field.name)
        if dataclasses.is_dataclass(value):
            for inner, other in _changed(value, place):
                yield inner, dataclasses.replace(config, **{field.name: other})
        else:
            yield place, _with_other_value(config, field.name, value)


def _with_other_value(config: Any, name: str, value: Any) -> Any:
    for other in [INSTEAD_OF_NONE[name]] if value is None else _other_values(value):
        try:
            changed = dataclasses.replace(config, **{name: other})
        except InputError:
            continue
        if changed != config:
            return changed
    raise AssertionError(f"no other value for {type(config).__name__}.{name}")


@pytest.mark.parametrize("environment", quick.IDS)
def test_every_field_of_a_configuration_comes_back_from_json(environment: str) -> None:
    default = _config(environment)
    changed = dict(_changed(default))
    assert len(changed) > 4
    for path, config in changed.items():
        data = json.loads(json.dumps(to_plain(config)))
        assert chosen_config(data, type(default), environment) == config != default, path


@cache
def _all_changed(environment: str) -> list[Any]:
    return [config for _, config in _changed(_config(environment))]


@pytest.mark.parametrize("environment", quick.IDS)
@settings(max_examples=6, deadline=None, phases=[Phase.generate])
@given(data=st.data())
def test_an_environment_is_made_again_from_its_json(environment: str, data: Any) -> None:
    """Whichever fields are changed, in a configuration or a mapping, with any other settings."""
    config = data.draw(st.sampled_from(_all_changed(environment)))
    choices: dict[str, list[Any]] = {
        "config": [config, to_plain(config), {}, None],
        "mapper": ["none", "albot1"],
        "world": ["square-loop", WORLD],
        "movables": [True, False],
        "observation": ["flat", "dict"],
        "odometer": quick.SENSORS["odometer"],
    }
    given_settings = {name: data.draw(st.sampled_from(of)) for name, of in choices.items()}
    env = gymnasium.make(environment, max_episode_steps=9, **given_settings)
    spec = env.spec
    assert spec is not None
    again = gymnasium.make(EnvSpec.from_json(spec.to_json()))
    one, other = env.unwrapped, again.unwrapped
    assert one._interface.identity == other._interface.identity  # type: ignore[attr-defined]
    assert one.observation_config == other.observation_config  # type: ignore[attr-defined]
    assert env.observation_space == again.observation_space
    assert env.action_space == again.action_space
    assert again.spec is not None and again.spec.max_episode_steps == 9
    assert EnvSpec.from_json(again.spec.to_json()) == EnvSpec.from_json(spec.to_json())
    for each in (one, other):
        each.close()


@pytest.mark.parametrize("environment", quick.IDS)
def test_it_then_has_the_same_episodes(environment: str) -> None:
    given_settings = {"world": "square-loop", "mapper": "albot1"}
    given_settings |= quick.SETTINGS.get(environment, {}) | {"world": "square-loop"}
    env = gymnasium.make(environment, **given_settings)
    assert env.spec is not None
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    assert_same(again.reset(seed=3), env.reset(seed=3))
    for action in quick.drawn_actions(environment, np.random.default_rng(0), 5):
        assert_same(again.step(action), env.step(action))


def test_numbers_of_numpy_and_the_mapper_s_config_may_be_in_settings() -> None:
    env = gymnasium.make(
        "Albot/Explore-v0",
        world=WORLD,
        mapper_config=Albot1Config(view_spacing=np.float64(0.3)),
        config={"actions": {"speed": np.float32(0.5)}, "claims": np.False_},
    )
    assert env.action_space.shape == (2,) and env.spec is not None
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json())).unwrapped
    assert again._interface.robots.actions.speed == 0.5  # type: ignore[attr-defined]
    assert again._interface.identity["mapper_config"]["view_spacing"] == 0.3  # type: ignore[attr-defined]


def test_a_batch_is_made_again_from_its_json() -> None:
    given_settings = {"world": ["square-loop", WORLD], "config": ExploreConfig(claims=False)}
    envs = gymnasium.make_vec(
        "Albot/Explore-v0",
        num_envs=2,
        mapper="none",
        autoreset_mode=AutoresetMode.SAME_STEP,
        **given_settings,
    )
    assert envs.spec is not None
    again = gymnasium.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert again.num_envs == 2 and again.single_action_space.shape == (2,)
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert_same(again.reset(seed=3), envs.reset(seed=3))


@pytest.mark.parametrize(
    ("world", "found"), [(quick.LOOP, "a World"), (WorldSet([quick.LOOP]), "a WorldSet")]
)
def test_what_json_cannot_hold_is_named(world: Any, found: str) -> None:
    env = gymnasium.make("Albot/Explore-v0", world=world, mapper="none")
    assert env.spec is not None
    with pytest.raises(InputError, match=rf"Explore-v0, world: expected .*JSON.* found {found}$"):
        env.spec.to_json()
    gymnasium.make(env.spec).reset(seed=1)  # As an object it goes on.


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"claim": True}, r"v0, config.claim: expected one of .*did you mean claims\?\)$"),
        ({"observations": {"part": []}}, r"config.observations.part: .*did you mean parts\?\)$"),
        ({"claims": 1}, "config.claims: expected true or false, found 1"),
        ({"actions": {"speed": -1}}, "config.actions.speed: expected a positive number, found -1"),
        ({"weights": 3}, "config.weights: expected a mapping with .*, found 3"),
        ("fast", "config: expected ExploreConfig, a mapping of its fields, or None, found 'fast'"),
    ],
)
def test_a_mapping_that_is_no_configuration_is_refused(config: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        gymnasium.make("Albot/Explore-v0", mapper="none", config=config)


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_an_unknown_setting_is_a_type_error_of_one_line(make: Any) -> None:
    """As Python's own for an unknown keyword, on which libraries try again without it."""
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'frameskip'$") as caught:
        make("Albot/Explore-v0", frameskip=4)
    assert isinstance(caught.value, InputError)
    sent = pickle.loads(pickle.dumps(caught.value))  # noqa: S301
    assert (type(sent), str(sent)) == (UnknownSettingError, str(caught.value))
