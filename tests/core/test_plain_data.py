"""Configurations to plain data and back, of every task."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np
import pytest

from albot_agents.task import (
    batch_settings,
    check_task,
    config_kind,
    read_settings,
    single_env_settings,
    task_names,
)
from albot_core.errors import InputError
from albot_core.plain_data import (
    Location,
    check_types,
    deep_merge,
    differences,
    read_array,
    read_config,
    read_record,
    read_value,
    to_plain,
)
from albot_env.tasks.core.observation import ObservationConfig
from albot_maps.generators.plan import Side

WHERE = Location("a.yml")


@pytest.mark.parametrize("task", task_names())
def test_the_configuration_of_every_task_comes_back(task: str) -> None:
    config = config_kind(task)()
    data = json.loads(json.dumps(to_plain(config)))
    assert read_config(config_kind(task), data, WHERE) == config
    assert read_config(config_kind(task), {}, WHERE) == config
    assert differences(data, to_plain(config)) == []


@pytest.mark.parametrize("task", task_names())
def test_every_task_tells_its_settings(task: str) -> None:
    known = batch_settings(task)
    assert {"world", "config", "mapper", "odometer", "max_episode_steps", "threads"} <= known.keys()
    data = {"mapper": "none", "threads": 2, "max_episode_steps": None}
    settings = read_settings(task, data, WHERE)
    assert settings == data
    assert single_env_settings(task, settings) == {"mapper": "none"}
    for name in ("num_envs", "autoreset_mode"):  # Ours to say.
        with pytest.raises(InputError, match=f"{name}: expected one of"):
            read_settings(task, {name: 3}, WHERE)


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        (np.array([[1.0, 2.5]]), [[1.0, 2.5]]),
        (np.float32(0.5), 0.5),
        (np.int64(3), 3),
        (np.True_, True),
        (PurePosixPath("a/b.yml"), "a/b.yml"),
        (Side.NORTH, "north"),
        ((1, np.array([2, 3])), [1, [2, 3]]),
        ({1: np.arange(2)}, {"1": [0, 1]}),
        (None, None),
    ],
)
def test_what_becomes_plain_data_can_be_written_as_json(value: object, plain: object) -> None:
    assert json.loads(json.dumps(to_plain(value))) == plain


def test_parts_that_are_left_out_stay() -> None:
    base = ObservationConfig(home_range=7.0, laser_sectors=5)
    read = read_config(ObservationConfig, {"parts": ["home"]}, WHERE, base)
    assert read == ObservationConfig(home_range=7.0, laser_sectors=5, parts=("home",))
    assert read_config(ObservationConfig, {"sonar": None}, WHERE).sonar is None
    nested = read_config(ObservationConfig, {"laser": {"beams": 91}}, WHERE).laser
    assert (nested.beams, nested.max_range) == (91, 30.0)


@pytest.mark.parametrize(
    ("kind", "data", "message"),
    [
        (float, True, "a number, found true"),
        (int, 1.5, "a whole number, found 1.5"),
        (bool, 1, "true or false, found 1"),
        (str, None, "text, found null"),
        (tuple[float, float], [1], r"a list of 2, found \[1\]"),
        (tuple[int, ...], [1, "a"], r"x\[1\]: expected a whole number, found a"),
        (int | str | None, [1], r"a whole number or text, found \[1\]"),
        (dict[str, float], {"a": "b"}, "x.a: expected a number, found b"),
        (dict[str, float], 3, "a mapping, found 3"),
        (list[int], 3, "a list, found 3"),
        (float, 10**400, "a number, found one that is too large"),
    ],
)
def test_what_is_of_another_kind_is_refused(kind: object, data: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_value(kind, data, WHERE.at("x"))
    assert str(caught.value).startswith("a.yml, x")


@pytest.mark.parametrize(
    ("shape", "data"),
    [
        ((3,), [1, 2]),
        ((3,), [[1, 2, 3]]),
        ((3,), [1, 2, None]),
        ((3,), ["1", "2", "3"]),
        ((2,), [True, False]),
        ((2,), [0.5, math.nan]),
        ((2,), [0.5, 1e300]),
        ((2,), [1, 10**39]),
        ((None, 4), [[1, 2, 3, 4], [1, 2, 3]]),
        ((None, 4), {"a": 1}),
        ((None, 4), [[]]),
        ((), "1"),
    ],
)
def test_what_is_no_array_of_numbers_is_refused(
    shape: tuple[int | None, ...], data: object
) -> None:
    with pytest.raises(InputError, match=r"a\.yml, x: expected .*numbers within ±1e\+12, found"):
        read_array(shape, data, WHERE.at("x"))


def test_an_array_is_of_the_shape_that_is_asked_for() -> None:
    assert read_array((None, 4), [], WHERE).shape == (0, 4)
    assert read_array((None,), [], WHERE).shape == (0,)
    array = read_array((None, 2), [[1, 2.5]], WHERE)
    assert (array.tolist(), array.dtype) == ([[1.0, 2.5]], np.float64)


def test_a_record_holds_all_its_keys() -> None:
    known = {"a": int, "b": str}
    assert read_record(known, {"a": 1, "b": "x"}, WHERE) == {"a": 1, "b": "x"}
    assert read_record(known, {"a": 1, "b": "x", "c": 0}, WHERE, others=True).keys() == known.keys()
    for data, message in (
        ({"a": 1}, "b: expected a value, found none"),
        ({"a": 1, "b": 2}, "b: expected text, found 2"),
        ({"a": 1, "b": "x", "c": 0}, "c: expected one of a, b"),
        ([], "a mapping with a, b"),
    ):
        with pytest.raises(InputError, match=message):
            read_record(known, data, WHERE)


def test_plain_data_is_laid_over_plain_data() -> None:
    base = {"a": {"b": 1, "c": [1]}, "d": 2}
    assert deep_merge(base, {"a": {"c": [2, 3]}, "e": {}}) == {
        "a": {"b": 1, "c": [2, 3]}, "d": 2, "e": {},
    }  # fmt: skip
    assert base == {"a": {"b": 1, "c": [1]}, "d": 2}
    assert differences(base, deep_merge(base, {"a": {"b": 5}})) == ["a.b 1, not 5"]


def test_of_long_lists_it_is_told_what_differs() -> None:
    parts = [f"part_{k}" for k in range(20)]
    assert differences(["a"], ["b"]) == [" [a], not [b]"]
    more, fewer = {"parts": [*parts, "last"]}, {"parts": parts[1:]}
    assert differences(more, fewer) == ["parts with [part_0, last]"]
    assert differences(fewer, more) == ["parts without [part_0, last]"]
    other = {"parts": [*parts[:-1], "other"]}
    assert differences({"parts": parts}, other) == ["parts with [part_19] and without [other]"]
    assert differences([*parts, "part_3"], parts) == [" with [part_3]"]
    assert differences([None, *parts, None], [None, *parts]) == [" with [null]"]
    turned = {"parts": parts[::-1]}
    expected = "parts in another order, the first [0]: part_0, not part_19"
    assert differences({"parts": parts}, turned) == [expected]


@pytest.mark.parametrize("task", task_names())
def test_a_configuration_made_in_python_has_its_types(task: str) -> None:
    config = config_kind(task)()
    check_types(config)
    if hasattr(config, "claims"):
        with pytest.raises(InputError, match=r"Config.claims: expected true or false, found 'no'"):
            check_types(_with(config, claims="no"))
    if getattr(config, "observations", None) is not None:
        wrong = _with(config.observations, has_compass=1)
        with pytest.raises(InputError, match=r"^ObservationConfig.has_compass: .* found 1"):
            check_types(replace(config, observations=wrong))


@dataclass(frozen=True)
class _Own:
    """A configuration as the mappers of others may have it."""

    is_on: bool = True
    maybe: bool | None = None
    path: Path = Path()
    array: np.ndarray = field(default_factory=lambda: np.zeros(2))
    names: frozenset[str] = frozenset({"a"})
    places: tuple[Location, ...] = (WHERE,)
    one_or_more: Location | tuple[Location, ...] = (WHERE,)


def test_fields_of_any_other_type_are_their_owners_to_check() -> None:
    check_types(_Own())
    with pytest.raises(InputError, match=r"_Own.is_on: expected true or false, found null"):
        check_types(_with(_Own(), is_on=None))
    with pytest.raises(InputError, match=r"_Own.maybe: expected true or false, found 'no'"):
        check_types(_with(_Own(), maybe="no"))


def _with(config: Any, **values: Any) -> Any:
    """A copy with values of any type, which the checks of the tests would refuse."""
    changed = copy.copy(config)
    for name, value in values.items():
        object.__setattr__(changed, name, value)
    return changed


def test_an_unknown_task_is_refused() -> None:
    with pytest.raises(InputError, match="did you mean Albot/Homing-v0"):
        check_task("Albot/Homming-v0")


@pytest.mark.parametrize("value", ["laser", 1])
def test_a_choice_is_one_of_its_values(value: Any) -> None:
    assert read_value(Literal["laser", 1], value, WHERE) == value


@pytest.mark.parametrize("value", ["lasr", True, None, []])
def test_a_choice_is_nothing_else(value: Any) -> None:
    with pytest.raises(InputError, match="one of laser, 1, found"):
        read_value(Literal["laser", 1], value, WHERE)
