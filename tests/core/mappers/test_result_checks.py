"""What a mapper from outside says amiss is refused, with its name and the reading's number."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers import registry
from albot_core.mappers.map_file import save_map
from albot_core.mappers.mapper import MapperBatch
from albot_core.mappers.registry import (
    MAPPERS,
    make_mapper,
    make_mappers,
    mapper_spec,
    register_mapper,
)
from albot_core.mappers.result_checks import (
    check_activity,
    check_corrected_poses,
    check_events,
    check_place,
    is_from_outside,
)
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, SegmentsLayer
from albot_core.sensing.reading import Readings
from tests.core.mappers import topological
from tests.core.mappers.topological import TopologicalMapper

BAD = 3
"""Number of the first reading after which the mapper is wrong."""
NAN = float("nan")


class Wrong(TopologicalMapper):
    """Its estimate has a wrong value from a reading on, or something else is wrong always."""

    wrong: tuple[str, Any]
    """The name of what is wrong, and its value."""

    @property
    def estimate(self) -> Any:
        estimate = super().estimate
        name, value = self.wrong
        if name == "estimate" and self._reading >= BAD:
            return value
        if self._reading >= BAD and hasattr(estimate, name):
            object.__setattr__(estimate, name, value)  # Types are checked in tests alone.
        return estimate

    @property
    def way_home(self) -> Any:
        name, value = self.wrong
        return value if name == "way_home" else np.zeros(7)

    def snapshot(self) -> Any:
        name, value = self.wrong
        return value if name == "snapshot" else super().snapshot()

    def state(self) -> Any:
        name, value = self.wrong
        return value if name == "state" else super().state()


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
    assert batch.updates.tolist() == [1]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("estimate", None, "an Estimate, found a NoneType, None"),
        ("estimate", np.zeros(3), r"an Estimate, found \[0\.0, 0\.0, 0\.0\]"),
        ("updates", None, "a whole number from 0, found a NoneType, None"),
        ("map_version", -1, "a whole number from 0, found a int, -1"),
        ("segments", 0.5, "a whole number from 0, found a float, 0.5"),
        ("place", "kitchen", "a whole number from 0, or None, found a str, 'kitchen'"),
        ("localised", None, "True or False, found a NoneType, None"),
    ],
)
def test_an_estimate_is_as_its_class_says(batch, monkeypatch, name, value, expected):
    monkeypatch.setattr(Wrong, "wrong", (name, value))
    follow(batch, BAD)
    where = "estimate" if name == "estimate" else rf"estimate\.{name}"
    with pytest.raises(
        InputError, match=rf"^mapper odd, reading {BAD}, {where}: expected {expected}$"
    ):
        follow(batch, 1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, np.int64(1)) for name in ("updates", "map_version", "segments", "place")),
        ("matched_reading", np.int32(BAD - 1)),
        ("matched_reading", BAD),  # That from which the estimate was made.
        *(("localised", value) for value in (True, False, np.True_, np.False_)),
        *((name, np.array((1, 2, 3))) for name in ("pose", "home")),
    ],
)
def test_an_estimate_may_hold_numbers_of_numpys(batch, monkeypatch, name, value):
    follow(batch, BAD)
    monkeypatch.setattr(Wrong, "wrong", (name, value))
    follow(batch, 1)
    assert batch.is_recognised[0] == (name == "matched_reading")
    assert batch.is_lost[0] == (name == "localised" and not value)


NOWHERE = PlaceNode(id=0, label="P1", pose=np.full(3, NAN), middle=np.zeros(2))
HERE = PlaceNode(id=0, label="P1", pose=np.zeros(3), middle=np.zeros(2))
AWAY = PlaceEdge(source=0, target=9, motion=np.zeros(3))
TWICE = MapSnapshot(layers=(PlaceGraph(), PlaceGraph()))


@pytest.mark.parametrize(
    ("snapshot", "message"),
    [
        (None, r"\(\): expected a MapSnapshot with a tuple of layers, found a NoneType"),
        ([], r"\(\): expected a MapSnapshot"),
        (
            MapSnapshot(layers=(SegmentsLayer(segments=np.zeros((1, 4))),)),
            r"layers\[0\]: expected a layer of its spec, once each: place_graph, found a Segments",
        ),
        (TWICE, r"layers\[1\]: expected a layer of its spec, once each: place_graph"),
        (
            MapSnapshot(layers=(PlaceGraph(nodes=(NOWHERE,)),)),
            r"layers\[0\]\.nodes\[0\]\.pose: expected an array of finite numbers, of shape \(3,\)",
        ),
        (
            MapSnapshot(layers=(PlaceGraph(nodes=(HERE,), edges=(AWAY,)),)),
            r"layers\[0\]\.edges\[0\]\.target: expected the id of a place, found a int, 9",
        ),
    ],
)
def test_a_snapshot_is_as_its_spec_says(batch, monkeypatch, snapshot, message):
    follow(batch, 2)
    assert batch.snapshot(0).place_graph.nodes
    monkeypatch.setattr(Wrong, "wrong", ("snapshot", snapshot))
    with pytest.raises(InputError, match=rf"^mapper odd, reading 1, snapshot.*{message}"):
        batch.snapshot(0)


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (None, r"state\(\): expected arrays of numbers by name, found a NoneType"),
        ({3: np.zeros(3)}, r"state\(\): expected arrays of numbers by name, found a int, 3"),
        ({"pose": [1, 2]}, r"state\(\)\['pose'\]: expected an array of numbers, found a list"),
        ({"pose": np.array([None])}, r"state\(\)\['pose'\]: expected an array of numbers, found"),
    ],
)
def test_a_state_is_arrays_of_numbers(batch, monkeypatch, tmp_path, state, message):
    follow(batch, 2)
    assert "pose" in batch.state(0)
    monkeypatch.setattr(Wrong, "wrong", ("state", state))
    with pytest.raises(InputError, match=rf"^mapper odd, reading 1, {message}"):
        batch.state(0)
    with pytest.raises(InputError, match=rf"^mapper odd, {message}"):
        save_map(make_mapper("odd"), tmp_path / "map.albot")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("events", [None, "hello", b"hello", 3])
def test_events_are_a_sequence(events):
    spec = MAPPERS["albot1"]
    check_events(("a door",), spec, 5)
    with pytest.raises(InputError, match=r"^mapper albot1, reading 5, events: expected a sequence"):
        check_events(events, spec, 5)


@pytest.mark.parametrize("place", [None, "kitchen", -1, 0.5])
def test_a_place_is_an_id(place):
    spec = MAPPERS["albot1"]
    check_place(0, spec, 5)
    with pytest.raises(InputError, match=r"^mapper albot1, reading 5, place_at\(\): expected"):
        check_place(place, spec, 5)


def test_an_activity_has_a_packet():
    spec = MAPPERS["ratslam"]
    right = Activity(cell=0.1, values=np.ones((2, 3), np.float32), packet=np.zeros(3))
    check_activity(right, spec, 5)
    with pytest.raises(InputError, match="activity: expected an Activity, found a NoneType"):
        check_activity(None, spec, 5)
    object.__setattr__(right, "packet", np.full(3, NAN))
    with pytest.raises(InputError, match=r"activity\.packet: expected an array of 3 finite"):
        check_activity(right, spec, 5)


def test_mappers_of_the_project_are_known():
    ours = {name: spec for name, spec in MAPPERS.items() if spec.factory.startswith("albot_core.")}
    assert not any(map(is_from_outside, ours.values()))
    assert is_from_outside(mapper_spec(f"{topological.__name__}:topological"))
