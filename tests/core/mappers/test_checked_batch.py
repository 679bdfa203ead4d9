"""What a batch from outside gives amiss is refused, with the mapper's name and what is wrong."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers import registry
from albot_core.mappers.checked_batch import CheckedMappers
from albot_core.mappers.looped import LoopedMappers
from albot_core.mappers.mapper import MapperBatch
from albot_core.mappers.registry import (
    MAPPERS,
    make_mapper,
    make_mappers,
    mapper_spec,
    register_mapper,
)
from albot_core.sensing.reading import Readings
from tests.core.mappers import topological

COUNT = 3
EVERYONE = np.arange(COUNT)
NAN = float("nan")


class OutsideBatch(LoopedMappers):
    """A batch as somebody else may write it: a loop over the topological mapper."""

    def __init__(self, count: int, *, config: Any, name: str) -> None:
        single = f"{topological.__name__}:topological"
        super().__init__([make_mapper(single, config=config) for _ in range(count)])
        self.begin()

    def begin(self) -> None:
        """What is wrong from the beginning."""

    def after(self) -> None:
        """What is wrong after each call."""

    def update(self, rows: np.ndarray, readings: Readings) -> None:
        super().update(rows, readings)
        self.after()

    def match_readings(self, rows: np.ndarray) -> None:
        super().match_readings(rows)
        self.after()

    def find_ways(self, rows: np.ndarray) -> None:
        super().find_ways(rows)
        self.after()


@pytest.fixture
def outside(monkeypatch: pytest.MonkeyPatch) -> type[OutsideBatch]:
    """The class of the batches that mapper `odd` makes; its methods can be replaced."""
    monkeypatch.setattr(registry, "MAPPERS", dict(MAPPERS))
    spec = mapper_spec(f"{topological.__name__}:topological")
    register_mapper(dataclasses.replace(spec, name="odd", batch=f"{__name__}:OutsideBatch"))
    monkeypatch.setattr(OutsideBatch, "begin", OutsideBatch.begin)  # Restored afterwards.
    monkeypatch.setattr(OutsideBatch, "after", OutsideBatch.after)
    return OutsideBatch


def follow(batch: MapperBatch, rows: np.ndarray = EVERYONE, count: int = 1) -> None:
    motions = np.tile((0.1, 0.0, 0.0), (COUNT, 1))
    for _ in range(count):
        batch.update(rows, Readings(stamps=np.zeros(COUNT), motions=motions))
        batch.find_ways(rows)
        batch.match_readings(rows)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("poses", np.zeros((COUNT, 2)), r"float64 of shape \(3, 3\), found one of float64 of"),
        ("poses", np.zeros((COUNT, 3), np.float32), "found one of float32"),
        ("poses", np.zeros((3, COUNT)).T, "found one that is not contiguous"),
        ("homes", np.zeros((COUNT + 1, 3)), r"found one of float64 of shape \(4, 3\)"),
        ("places", np.zeros((COUNT, 2), np.int8), "array of bool of .* found one of int8"),
        ("matched_readings", np.full(COUNT, -1.0), "array of int64 of .* found one of float64"),
        ("ways_home", [[0.0] * 7] * COUNT, "found a list"),
        ("ways_home", None, "found a NoneType, None"),
    ],
)
def test_arrays_have_their_type_and_shape(
    outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch, name: str, value: Any, told: str
) -> None:
    monkeypatch.setattr(outside, "begin", lambda self: setattr(self, name, value))
    with pytest.raises(InputError, match=f"^mapper odd, batch, {name}: expected .*{told}"):
        make_mappers("odd", COUNT)


def test_arrays_stay_the_same(outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch) -> None:
    batch = make_mappers("odd", COUNT)
    monkeypatch.setattr(outside, "after", lambda self: setattr(self, "homes", self.homes.copy()))
    with pytest.raises(InputError, match=r"^mapper odd, batch, homes: expected always the same"):
        follow(batch)


def test_another_view_of_the_same_numbers_is_the_same_array(
    outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outside, "after", lambda self: setattr(self, "homes", self.homes[:]))
    batch = make_mappers("odd", COUNT)
    follow(batch, count=3)
    assert batch.poses[:, 0] == pytest.approx([0.2] * COUNT)


def test_the_state_of_a_bare_batch_is_refused_and_changes_nothing(
    outside: type[OutsideBatch],
) -> None:
    batch = make_mappers("odd", COUNT)
    assert isinstance(batch, CheckedMappers)
    early = batch._mappers.state(0)
    follow(batch)
    with pytest.raises(InputError, match=r"^mapper odd, batch, restore: expected an array checked"):
        batch.restore(0, early)
    assert batch.poses[0].tolist() == batch.poses[1].tolist()


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("poses", (0.0, NAN, 0.0), r"expected 3 finite numbers, .* found \[0\.0, nan, 0\.0\]"),
        ("homes", (np.inf, 0.0, 0.0), "expected 3 finite numbers"),
        ("matched_readings", 5, "expected the number of an earlier reading, or -1, found 5"),
        ("matched_readings", -2, "expected the number of an earlier reading, or -1, found -2"),
        ("ways_home", 7 * (NAN,), "expected 7 numbers, of which the last is not NaN"),
    ],
)
def test_numbers_of_the_rows_of_a_call_are_checked(
    outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch, name: str, value: Any, told: str
) -> None:
    batch = make_mappers("odd", COUNT)
    follow(batch, count=4)

    def spoil(self: OutsideBatch) -> None:
        getattr(self, name)[2] = value

    monkeypatch.setattr(outside, "after", spoil)
    follow(batch, EVERYONE[:2])  # The third robot's mapper may be at work in another thread.
    with pytest.raises(InputError, match=rf"^mapper odd, reading 4, {name}\[2\]: {told}"):
        follow(batch)
    batch.reset(2, np.random.default_rng(0))
    with pytest.raises(InputError, match=rf"^mapper odd, reading 0, {name}\[2\]: {told}"):
        follow(batch)


@pytest.mark.parametrize("name", ["updates", "map_versions", "segment_counts"])
def test_counts_are_whole_numbers(outside: type[OutsideBatch], name: str) -> None:
    batch = make_mappers("odd", COUNT)
    assert isinstance(batch, CheckedMappers)
    assert getattr(batch, name).tolist() == [0] * COUNT
    setattr(batch._mappers, name, np.zeros(COUNT))
    with pytest.raises(InputError, match=f"^mapper odd, batch, {name}: .* found one of float64"):
        getattr(batch, name)


@pytest.mark.parametrize("readings", [0, 1, 4])
@pytest.mark.parametrize("name", ["state", "snapshot", "activity"])
def test_what_one_gives_amiss_is_of_its_latest_reading(
    outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch, name: str, readings: int
) -> None:
    batch = make_mappers("odd", COUNT)
    follow(batch)
    batch.reset(1, np.random.default_rng(0))
    follow(batch, EVERYONE[1:2], count=readings)
    monkeypatch.setattr(outside, name, lambda self, row: "none")
    when = f"reading {readings - 1}" if readings else "before the first reading"
    with pytest.raises(InputError, match=rf"^mapper odd, {when}, {name}"):
        getattr(batch, name)(1)


def test_what_is_no_batch_is_refused(
    outside: type[OutsideBatch], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.OutsideBatch", lambda count, config, name: object())
    with pytest.raises(InputError, match=r"^mapper odd, batch: expected the members of Mapper"):
        make_mappers("odd", COUNT)


def test_a_right_batch_gives_what_it_would_alone(outside: type[OutsideBatch]) -> None:
    batch = make_mappers("odd", COUNT)
    alone = outside(COUNT, config=batch._mappers._mappers[0].config, name="odd")
    for made in (batch, alone):
        made.reset(1, np.random.default_rng(0))
        follow(made, count=5)
        made.begin_return(0)
    twin = make_mappers("odd", COUNT)
    twin.restore(0, batch.state(0))
    follow(twin, EVERYONE[:1])
    follow(batch, EVERYONE[:1])
    follow(alone, EVERYONE[:1])
    assert isinstance(batch, MapperBatch)
    for name in ("poses", "homes", "places", "matched_readings", "ways_home", "updates"):
        np.testing.assert_array_equal(getattr(batch, name), getattr(alone, name))
        np.testing.assert_array_equal(getattr(twin, name)[0], getattr(alone, name)[0])
    assert batch.activity(0) is None
    assert len(batch.snapshot(0).layers) == len(alone.snapshot(0).layers)
