"""How mapping systems are found by name."""

from __future__ import annotations

import dataclasses
import inspect
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers import registry
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.looped import LoopedMappers
from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.registry import (
    MAPPERS,
    installed_mappers,
    make_mapper,
    make_mappers,
    mapper_names,
    mapper_spec,
    register_mapper,
)
from albot_core.maps.layers import LAYERS
from tests.core.mappers import grid, topological

OURS = (
    "albot0",
    "albot0-paper",
    "albot1",
    "albot1-thesis",
    "albot1-tracked",
    "association",
    "association-paper",
    "dp-slam",
    "fastslam",
    "gmapping",
    "graph-slam",
    "grid-slam",
    "hssh",
    "karto",
    "odometry",
    "ratslam",
    "ratslam-paper",
    "ratslam-scenes",
    "sahabot",
    "sahabot-wheels",
    "scan-matching",
)


def test_the_names():
    assert mapper_names()[: len(OURS)] == OURS
    assert all(name == spec.name for name, spec in MAPPERS.items())
    assert all(spec.summary.endswith(".") and spec.paper for spec in MAPPERS.values())
    assert all(set(spec.layers) <= set(LAYERS) for spec in MAPPERS.values())


@pytest.mark.parametrize(
    ("typed", "meant"), [("albot", "albot1"), ("Odometry", "odometry"), ("albot1-teses", "thesis")]
)
def test_a_mistyped_name_is_guessed(typed, meant):
    with pytest.raises(InputError, match=f"did you mean .*{meant}"):
        make_mapper(typed)


def test_a_name_like_none():
    with pytest.raises(
        InputError,
        match=r"one of albot0, albot0-paper, albot1, albot1-thesis, .*, found 'xyz'$",
    ):
        make_mapper("xyz")


def test_no_mapper_is_imported_before_it_is_made():
    code = (
        "import sys, albot_core.mappers.registry as r; r.mapper_names(); "
        "sys.exit(any('numba' in name or 'albot1.' in name for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_name_may_begin_with_the_module_that_registers_it():
    name = "tests.core.mappers.topological:topological"
    assert mapper_spec(name) is MAPPERS["topological"]
    assert isinstance(make_mapper(name), topological.TopologicalMapper)
    with pytest.raises(InputError, match=r"module that can be imported.*no_such_module"):
        make_mapper("no_such_module:topological")


@pytest.mark.parametrize("module", ["", "..a", ".a", "odd_syntax"])
def test_a_module_that_cannot_be_imported_is_one_clear_error(module, tmp_path, monkeypatch):
    (tmp_path / "odd_syntax.py").write_text("def\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"mapper: expected a module that can be imported"):
        mapper_spec(f"{module}:topological")


def test_a_name_is_registered_once():
    register_mapper(MAPPERS["grid"])
    other = MapperSpec(
        name="grid", summary="", paper="", sensors=frozenset(), layers=(), factory="", config=""
    )
    with pytest.raises(InputError, match="no other mapper has, found 'grid'"):
        register_mapper(other)
    assert MAPPERS["grid"].factory.endswith("grid:GridMapper")


def _named(**changes: Any) -> str:
    """Register the topological mapper under another name, with changes to its spec."""
    spec = dataclasses.replace(mapper_spec("topological"), name="odd")
    for field, value in changes.items():
        object.__setattr__(spec, field, value)  # Types are checked in tests alone.
    register_mapper(spec)
    return spec.name


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"layers": ("place_grph",)},
            r"mapper odd, layers: .* place_grph \(did you mean place_gra",
        ),
        (
            {"sensors": frozenset({"lidar"})},
            "mapper odd, sensors: expected only laser, sonar, scen",
        ),
        ({"factory": f"{topological.__name__}:TopologcalMapper"}, "factory: .*did you mean Topol"),
        ({"config": f"{topological.__name__}:Nope"}, "config: expected a name in its module"),
        (
            {"factory": f"{__name__}:Incomplete"},
            "odd, factory: expected .* spec, config, .* found Incomplete without spec, update",
        ),
    ],
)
def test_what_is_wrong_with_a_mapper_is_said_before_it_works(changes, message, monkeypatch):
    monkeypatch.setattr(registry, "MAPPERS", dict(MAPPERS))
    with pytest.raises(InputError, match=message):
        make_mapper(_named(**changes))


class Incomplete:
    """Lacks `spec` and `update`."""

    estimate = reset = snapshot = state = restore = None

    def __init__(self, config: object, name: str) -> None:
        self.config = config


def test_a_config_is_of_the_mappers_own_class():
    config = grid.GridConfig(particles=3)
    assert make_mapper("grid", config=config).config is config
    with pytest.raises(InputError, match="mapper grid, config: expected a mapping or GridConfig"):
        make_mapper("grid", config=Albot1Config())
    with pytest.raises(InputError, match="expected a mapping or GridConfig"):
        make_mappers("grid", 2, config=Albot1Config())


@pytest.mark.parametrize("count", [0, -1, 1.5, "a", None])
@pytest.mark.parametrize("name", ["albot1", "odometry"])
def test_a_batch_is_of_one_robot_or_more(name: str, count: Any):
    make = inspect.unwrap(make_mappers)  # Users' types are not checked as those of the tests are.
    expected = "^make_mappers, count: expected a whole number from 1, found"
    with pytest.raises(InputError, match=f"{expected} {count}$"):
        make(name, count)


def test_by_its_own_class_or_by_its_name_a_mapper_is_the_same():
    for name in set(OURS) & set(installed_mappers()):
        made = make_mapper(name)
        assert type(made)(made.config, name).spec == made.spec
    assert make_mapper("albot1").config == Albot1Config()


def test_a_generator_decides_what_is_drawn():
    one, same, other = (make_mapper("grid", rng=np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one._rng.random() == same._rng.random() != other._rng.random()


COUNT = 3


class OutsideBatch(LoopedMappers):
    """A batch as somebody else may write it: a loop over the topological mapper."""

    def __init__(self, count: int, *, config: Any, name: str) -> None:
        single = f"{topological.__name__}:topological"
        super().__init__([make_mapper(single, config=config) for _ in range(count)])
        self.begin()

    def begin(self) -> None:
        """What is wrong from the beginning."""


@pytest.fixture
def outside(monkeypatch: pytest.MonkeyPatch) -> type[OutsideBatch]:
    """The class of the batches that mapper `odd` makes."""
    monkeypatch.setattr(registry, "MAPPERS", dict(registry.MAPPERS))
    spec = mapper_spec(f"{topological.__name__}:topological")
    register_mapper(dataclasses.replace(spec, name="odd", batch=f"{__name__}:OutsideBatch"))
    return OutsideBatch


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("poses", np.zeros((COUNT, 2)), r"float64 of shape \(3, 3\), found one of float64 of"),
        ("poses", np.zeros((COUNT, 3), np.float32), "found one of float32"),
        ("poses", np.zeros((3, COUNT)).T, "found one that is not contiguous"),
        ("homes_in_map", np.zeros((COUNT + 1, 3)), r"found one of float64 of shape \(4, 3\)"),
        ("is_lost", np.zeros(COUNT, np.int8), "array of bool of .* found one of int8"),
        ("matched_readings", np.full(COUNT, -1.0), "array of int64 of .* found one of float64"),
        ("ways_home", [[0.0] * 7] * COUNT, "found a list"),
        ("ways_home", None, "found a NoneType, None"),
    ],
)
def test_arrays_have_their_type_and_shape(
    outside: type[OutsideBatch],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    value: Any,
    message: str,
) -> None:
    monkeypatch.setattr(outside, "begin", lambda self: setattr(self, name, value))
    with pytest.raises(InputError, match=f"^mapper odd, batch, {name}: expected .*{message}"):
        make_mappers("odd", COUNT)


def test_what_is_no_batch_is_refused(
    outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.OutsideBatch", lambda count, config, name: object())
    with pytest.raises(InputError, match=r"^mapper odd, batch: expected the members of Mapper"):
        make_mappers("odd", COUNT)


def test_a_right_batch_is_what_is_made(outside: type[OutsideBatch]) -> None:
    assert isinstance(make_mappers("odd", COUNT), outside)
