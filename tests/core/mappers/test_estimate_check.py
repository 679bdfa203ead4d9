"""What a mapper from outside says amiss is refused, with its name and the reading's number."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers import registry
from albot_core.mappers.estimate_check import check_corrected_poses
from albot_core.mappers.mapper import Estimate, MapperBatch
from albot_core.mappers.registry import MAPPERS, make_mappers, mapper_spec, register_mapper
from albot_core.sensing.reading import Readings
from tests.core.mappers import topological
from tests.core.mappers.topological import TopologicalMapper

BAD = 3
"""Number of the first reading after which the mapper is wrong."""
NAN = float("nan")


class Wrong(TopologicalMapper):
    """Its estimate, or its way home, has a wrong value from a reading on."""

    wrong: tuple[str, Any]
    """The name of what is wrong, and its value."""

    @property
    def estimate(self) -> Estimate:
        estimate = super().estimate
        name, value = self.wrong
        if self._reading >= BAD and name != "way_home":
            object.__setattr__(estimate, name, value)  # Types are checked in tests alone.
        return estimate

    @property
    def way_home(self) -> Any:
        name, value = self.wrong
        return value if name == "way_home" else np.zeros(7)


@pytest.fixture
def batch(monkeypatch: pytest.MonkeyPatch) -> MapperBatch:
    """A robot with the mapper."""
    monkeypatch.setattr(registry, "MAPPERS", dict(MAPPERS))
    spec = mapper_spec(f"{topological.__name__}:topological")
    register_mapper(dataclasses.replace(spec, name="odd", factory=f"{__name__}:Wrong"))
    monkeypatch.setattr(Wrong, "wrong", ("pose", np.zeros(3)), raising=False)
    return make_mappers("odd", 1)


def follow(batch: MapperBatch, count: int) -> None:
    row = np.zeros(1, np.int64)
    for _ in range(count):
        batch.update(row, Readings(stamps=np.zeros(1), motions=np.zeros((1, 3))))
        batch.find_ways(row)


@pytest.mark.parametrize(
    ("name", "value", "found"),
    [
        ("pose", np.array((0.0, NAN, 0.0)), r"\[0\.0, nan, 0\.0\]"),
        ("pose", np.array((np.inf, -np.inf, 0.0)), r"\[inf, -inf, 0\.0\]"),
        ("pose", np.zeros(2), r"\[0\.0, 0\.0\]"),
        ("pose", np.zeros(()), r"0\.0"),
        ("pose", np.zeros((4, 4)), r"an array of shape \(4, 4\)"),
        ("pose", np.array(("x", "y", "z")), r"\['x', 'y', 'z'\]"),
        ("pose", None, "a NoneType, None"),
        ("home", (0.0, 0.0, 0.0), r"a tuple, \(0\.0, 0\.0, 0\.0\)"),
        ("home", np.array((0.0, 0.0, NAN)), r"\[0\.0, 0\.0, nan\]"),
    ],
)
def test_a_pose_is_three_finite_numbers(batch, monkeypatch, name, value, found):
    monkeypatch.setattr(Wrong, "wrong", (name, value))
    follow(batch, BAD)
    expected = rf"^mapper odd, reading {BAD}, estimate\.{name}: expected an array of 3 finite"
    with pytest.raises(InputError, match=rf"{expected} numbers, .* found {found}$"):
        follow(batch, 1)
    # After a reset the readings are counted anew.
    batch.reset(0, np.random.default_rng(0))
    follow(batch, BAD)
    with pytest.raises(InputError, match=expected):
        follow(batch, 1)


@pytest.mark.parametrize("matched", [-1, BAD + 1, 0.5, "a", True, np.array(1)])
def test_a_matched_reading_is_an_earlier_one(batch, monkeypatch, matched):
    monkeypatch.setattr(Wrong, "wrong", ("matched_reading", matched))
    follow(batch, BAD)
    expected = rf"^mapper odd, reading {BAD}, estimate\.matched_reading: expected the number of an"
    with pytest.raises(InputError, match=rf"{expected} earlier .* found (a \w+, )?'?{matched}'?$"):
        follow(batch, 1)


@pytest.mark.parametrize("way", [np.zeros(5), np.full(7, NAN), None])
def test_a_way_home_is_seven_numbers(batch, monkeypatch, way):
    follow(batch, 1)
    monkeypatch.setattr(Wrong, "wrong", ("way_home", way))
    with pytest.raises(InputError, match=r"^mapper odd, reading 1, way_home: expected an array"):
        follow(batch, 1)


def test_parts_of_a_way_home_may_be_unknown(batch, monkeypatch):
    monkeypatch.setattr(Wrong, "wrong", ("way_home", np.array((*6 * (NAN,), np.inf))))
    follow(batch, 1)
    assert batch.ways_home[0, 6] == np.inf


def test_before_the_first_reading_too(monkeypatch, batch):
    monkeypatch.setattr(Wrong, "wrong", ("pose", np.zeros(2)))
    monkeypatch.setattr(f"{__name__}.BAD", -1)
    with pytest.raises(InputError, match=r"^mapper odd, before the first reading, estimate\.pose:"):
        make_mappers("odd", 1)


@pytest.mark.parametrize(
    ("poses", "found"),
    [
        (np.zeros((4, 3)), r"an array of shape \(4, 3\)"),
        (np.zeros((5, 2)), r"an array of shape \(5, 2\)"),
        (np.array([[0.0, 0.0, NAN]] * 5), r"an array of shape \(5, 3\), not finite at \(0, 2\)"),
        (np.zeros((5, 3), bool), r"an array of bool of shape \(5, 3\)"),
        ([(0.0, 0.0, 0.0)] * 5000, "a list, .{0,150}"),
    ],
)
def test_corrected_poses_are_three_finite_numbers_a_reading(poses, found):
    spec = MAPPERS["graph-slam"]
    check_corrected_poses(np.zeros((5, 3)), spec, 5)
    expected = r"^mapper graph-slam, reading 4, corrected_poses\(\): expected an array of finite"
    with pytest.raises(InputError, match=rf"{expected} .* \(5, 3\), found {found}$"):
        check_corrected_poses(poses, spec, 5)


def test_where_the_mapper_is_right_nothing_is_said(batch):
    follow(batch, 10)
