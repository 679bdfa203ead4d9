"""Every number of every configuration is checked: what is no number is refused by its name."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import json
import math
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import albot_agents
import albot_core
import albot_env
import albot_experiments
import albot_maps
from albot_agents.trained.encoders import PartEncoder
from albot_agents.trained.network import NetworkConfig
from albot_agents.training.pretrain_plan import PretrainPlan
from albot_agents.training.sweep_plan import SearchSpace, SweepPlan
from albot_core.errors import InputError
from albot_core.maps.activity import Activity
from albot_core.maps.layers import OccupancyGridLayer
from albot_env.tasks.place_recognition.spaces import (
    AnswerActionConfig,
    ArrivalsObservationConfig,
)
from albot_maps.generators.parameters import Parameters
from albot_maps.movables import Box, Door, Walker

ORIGIN = np.zeros(3)
DEFAULTS = Path(__file__).with_name("defaults.json")
"""All defaults. `python -m tests.test_configurations` writes them."""
EXAMPLES: tuple[Any, ...] = (
    NetworkConfig(inputs=3, layers=(4,), activation="tanh", outputs=2),
    PartEncoder(part="map_patch", kind="convolution", begin=0, shape=(1, 4, 4)),
    PretrainPlan(agent="albot1-homing"),
    SearchSpace(low=1.0, high=2.0),
    SweepPlan(parameters={"gamma": SearchSpace(low=0.9, high=0.99)}),
    AnswerActionConfig(most=3),
    ArrivalsObservationConfig(most=3),
    Door(hinge=(0.0, 0.0), heading=0.0, width=1.0),
    Box(at=(0.0, 0.0)),
    Walker(route=((0.0, 0.0), (1.0, 0.0))),
    Activity(cell=1.0, values=np.ones((2, 2), np.float32), packet=ORIGIN),
    OccupancyGridLayer(origin=ORIGIN, resolution=1.0, occupancy=np.ones((2, 2), np.float32)),
)
"""One of each kind that cannot be made without arguments."""


def _kinds() -> Iterator[type]:
    """All kinds of our libraries that hold settings or check what they hold."""
    for library in (albot_core, albot_maps, albot_env, albot_agents, albot_experiments):
        for found in pkgutil.walk_packages(library.__path__, f"{library.__name__}."):
            for kind in vars(importlib.import_module(found.name)).values():
                ours = inspect.isclass(kind) and kind.__module__ == found.name
                if not ours or not dataclasses.is_dataclass(kind) or kind is Parameters:
                    continue
                if inspect.isabstract(kind):
                    continue
                check = getattr(kind, "__post_init__", None)  # Not one of another library's.
                if kind.__name__.endswith("Config") or "albot_" in getattr(check, "__module__", ""):
                    yield kind


def _examples() -> Iterator[Any]:
    given = {type(example) for example in EXAMPLES}
    yield from EXAMPLES
    for kind in _kinds():
        needed = [
            field
            for field in dataclasses.fields(kind)
            if field.default is field.default_factory is dataclasses.MISSING
        ]
        if kind not in given and (not needed or kind.__name__.endswith("Config")):
            yield kind()


def _numbers() -> Iterator[Any]:
    """Each numeric field of each configuration, and the types of what it may be."""
    for example in _examples():
        hints = get_type_hints(type(example))
        for field in dataclasses.fields(example):
            hint = hints[field.name]
            kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
            if {int, float} & set(kinds):
                name = f"{type(example).__name__}.{field.name}"
                yield pytest.param(example, field.name, frozenset(kinds), id=name)


@pytest.mark.parametrize(("example", "name", "kinds"), list(_numbers()))
def test_what_is_no_number_is_refused_by_the_fields_name(
    example: Any, name: str, kinds: frozenset[type]
) -> None:
    given = {field.name: getattr(example, field.name) for field in dataclasses.fields(example)}
    # Users' types are not checked as those of the test run are.
    unchecked = inspect.unwrap(type(example).__init__)
    fractions = () if float in kinds else (1.5, 2.0)  # Where whole numbers are expected.
    for wrong in ("a", None, math.nan, True, [1.0], 1j, *fractions):
        if wrong is None and NoneType in kinds:
            continue
        with pytest.raises(InputError) as refused:
            unchecked(object.__new__(type(example)), **given | {name: wrong})
        place = f"{refused.value.source}, {refused.value.place}"
        assert name in place, place
        assert refused.value.found in (str(wrong), repr(wrong))


def _defaults() -> dict[str, Any]:
    """The default of each setting that has one, in plain data, by its name."""
    found: dict[str, Any] = {}
    for kind in _kinds():
        for field in dataclasses.fields(kind):
            if field.default is not dataclasses.MISSING:
                found |= _plain(f"{kind.__name__}.{field.name}", field.default)
            elif field.default_factory is not dataclasses.MISSING:
                found |= _plain(f"{kind.__name__}.{field.name}", field.default_factory())
    return found


def _plain(name: str, value: Any) -> dict[str, Any]:
    if dataclasses.is_dataclass(value):
        parts = ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value))
        return {
            key: of for part, inner in parts for key, of in _plain(f"{name}.{part}", inner).items()
        }
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return {name: json.loads(json.dumps(value, default=str))}


def test_defaults_are_those_that_figures_were_measured_with() -> None:
    """Whoever changes one measures again what the documents say, and then writes them anew."""
    kept, found = json.loads(DEFAULTS.read_text(encoding="utf-8")), _defaults()
    changed = {
        name: (kept.get(name), found.get(name))
        for name in kept.keys() | found.keys()
        if name not in kept or name not in found or kept[name] != found[name]
    }
    assert not changed


if __name__ == "__main__":
    DEFAULTS.write_text(json.dumps(_defaults(), indent=1, sort_keys=True) + "\n", encoding="utf-8")
