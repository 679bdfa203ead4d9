"""A robot of a batch does to the last bit what a single one does."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from albot_core.mappers.albot1.addresses import MAP_ROOM, VIEW_ROOM
from albot_core.mappers.albot1.batch import Albot1Batch
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.looped import LoopedMappers
from albot_core.mappers.mapper import MapperBatch
from albot_core.mappers.registry import make_mapper, make_mappers
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading, Readings

RNG = np.random.default_rng(0)

LASER = LaserGeometry(beams=61, spacing=np.radians(3.0))
SPACED = {"view_spacing": 0.3, "view_turn": np.radians(15.0)}
CONFIGS = [
    Albot1Config.thesis(),
    Albot1Config(),
    replace(Albot1Config.thesis(), submap_matching=True, **SPACED),
    Albot1Config.tracked(),
]


def hall(poses: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Ranges (robots, beams) in a hall of 20 x 14 m with a wall of teeth, with noise."""
    bearings = poses[:, 2:] + LASER.bearings
    cos, sin = np.cos(bearings), np.sin(bearings)
    ranges = np.full(bearings.shape, np.inf)
    for axis, along, low, high in ((0, cos, -10.0, 10.0), (1, sin, -7.0, 7.0)):
        for wall in (low, high):
            with np.errstate(divide="ignore"):
                reach = (wall - poses[:, axis : axis + 1]) / along
            ranges = np.where(reach > 0, np.minimum(ranges, reach), ranges)
    hit = poses[:, :1] + ranges * cos
    ranges -= np.where(np.floor(hit / 1.3) % 2 == 0, 0.5, 0.0)
    return np.abs(ranges + rng.normal(0, 0.01, ranges.shape))


class Drive:
    """Robots that wander about the hall."""

    def __init__(self, count: int, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._poses = self._rng.uniform(-3, 3, (count, 3))

    def step(self) -> Readings:
        count = len(self._poses)
        motions = self._rng.normal((0.08, 0.0, 0.0), (0.05, 0.01, 0.1), (count, 3))
        cos, sin = np.cos(self._poses[:, 2]), np.sin(self._poses[:, 2])
        self._poses[:, 0] += cos * motions[:, 0] - sin * motions[:, 1]
        self._poses[:, 1] += sin * motions[:, 0] + cos * motions[:, 1]
        self._poses[:, 2] += motions[:, 2]
        gone = np.abs(self._poses[:, :2]).max(axis=1) > 5
        self._poses[gone, :2] = 0.0  # carried back: a map full of contradictions
        ranges = hall(self._poses, self._rng)
        return Readings(stamps=np.zeros(count), motions=motions, laser=LASER, ranges=ranges)


def same(batch: Albot1Batch, row: int, single: Albot1) -> None:
    theirs, mine = single.state(), batch.state(row)
    assert mine.keys() == theirs.keys()
    for name, array in theirs.items():
        np.testing.assert_array_equal(mine[name], array, err_msg=f"{name} of {row}")
    np.testing.assert_array_equal(batch.poses[row], single.estimate.pose)
    np.testing.assert_array_equal(batch.surfaces(row), single.snapshot().segments)
    assert batch.updates[row] == single.updates
    assert batch.lost[row] == single.lost
    assert batch.segment_counts[row] == len(single.snapshot().segments)


@pytest.mark.parametrize("config", CONFIGS, ids=["thesis", "improved", "spaced", "tracked"])
def test_a_batch_does_what_single_ones_do(config: Albot1Config) -> None:
    count, rng = 5, np.random.default_rng(1)
    batch, drive = Albot1Batch(count, config), Drive(count, 2)
    singles = [Albot1(config) for _ in range(count)]
    for step in range(700):
        readings = drive.step()
        rows = rng.permutation(count)[: rng.integers(0, count + 1)]
        if step % 97 == 96:
            batch.reset(step % count, RNG)
            singles[step % count].reset(RNG)
        batch.update(rows, readings)
        for row in rows.tolist():
            singles[row].update(readings[row])
            np.testing.assert_array_equal(batch.poses[row], singles[row].estimate.pose)
        if step % 50 == 0:
            for row, single in enumerate(singles):
                same(batch, row, single)
    for row, single in enumerate(singles):
        same(batch, row, single)
    assert batch.updates.max() > 5


def tiles(count: int) -> list[Reading]:
    """Scans of a row of posts each, all else far away: many surfaces, ever new ones."""
    fine = LaserGeometry(beams=361, spacing=np.radians(0.5))
    ranges = np.where(np.arange(361) // 3 % 2 == 0, 12.0, np.inf)
    scan = LaserScan(ranges=ranges, geometry=fine)
    return [
        Reading(stamp=float(k), motion=np.array((30.0, 0.0, 0.0)), laser=scan) for k in range(count)
    ]


def test_maps_grow_and_are_emptied() -> None:
    batch, single = make_mappers("albot1", 3), make_mapper("albot1")
    assert isinstance(batch, Albot1Batch)
    assert isinstance(single, Albot1)
    for _ in range(2):
        for reading in tiles(60):  # all strange, so that every other one is laid over the map
            geometry = reading.laser.geometry
            motions, ranges = reading.motion[None], reading.laser.ranges[None]
            everyone = Readings(
                stamps=np.zeros(3),
                motions=np.repeat(motions, 3, axis=0),
                laser=geometry,
                ranges=np.repeat(ranges, 3, axis=0),
            )
            batch.update(np.array([2, 0]), everyone)
            single.update(reading)
        assert len(single.snapshot().segments) > 400
        same(batch, 0, single)
        same(batch, 2, single)
        assert batch.segment_counts[1] == 0
        for row in (0, 2):
            batch.reset(row, RNG)
            assert batch.surfaces(row).shape == (0, 4)
            assert not batch.poses[row].any()
        single.reset(RNG)


def test_a_robot_gets_room_for_a_larger_map_and_a_larger_view_and_forgets_nothing() -> None:
    """A view may hold more than all before; without room for it the step would never be done."""
    batch, drive = Albot1Batch(2), Drive(2, 5)
    for _ in range(5):
        batch.update(np.arange(2), drive.step())
    states, rooms = [batch.state(row) for row in range(2)], [MAP_ROOM, VIEW_ROOM]
    before = batch._robots.table[:, rooms]
    batch._enlarge(1)
    assert (batch._robots.table[:, rooms] // before).tolist() == [[1, 1], [2, 2]]
    for row, state in enumerate(states):
        for name, array in batch.state(row).items():
            np.testing.assert_array_equal(array, state[name], err_msg=name)


def test_two_threads_may_lead_disjoint_rows() -> None:
    count, steps = 6, 150
    drive = Drive(count, 3)
    given = [drive.step() for _ in range(steps)]
    one, two = (Albot1Batch(count, CONFIGS[1]) for _ in range(2))
    halves = np.array([0, 2, 4]), np.array([1, 3, 5])

    def lead(batch: Albot1Batch, rows: np.ndarray) -> None:
        for step, readings in enumerate(given):
            if step % 40 == 39:
                batch.reset(int(rows[0]), RNG)
            batch.update(rows, readings)

    threads = [threading.Thread(target=lead, args=(two, half)) for half in halves]
    for thread in threads:
        thread.start()
    for half in halves:
        lead(one, half)
    for thread in threads:
        thread.join()
    for row in range(count):
        for name, array in one.state(row).items():
            np.testing.assert_array_equal(two.state(row)[name], array)
    np.testing.assert_array_equal(two.poses, one.poses)


def test_one_of_a_batch_is_saved_and_goes_on_in_another() -> None:
    config, drive = CONFIGS[2], Drive(2, 4)
    first, second = Albot1Batch(2, config), Albot1Batch(3, config)
    given = [drive.step() for _ in range(60)]
    everyone = np.arange(2)
    for readings in given[:33]:
        first.update(everyone, readings)
    assert first.state(1)["since"].any()
    for row in range(2):
        second.restore(row, first.state(row))
    np.testing.assert_array_equal(second.poses[:2], first.poses)
    for readings in given[33:]:
        first.update(everyone, readings)
        second.update(everyone, readings)
    np.testing.assert_array_equal(second.poses[:2], first.poses)
    np.testing.assert_array_equal(second.surfaces(1), first.surfaces(1))


def test_mappers_without_a_batch_are_led_one_by_one() -> None:
    batch = make_mappers("association", 2)
    assert isinstance(batch, LoopedMappers)
    for name in ("albot1", "albot1-thesis"):
        assert isinstance(make_mappers(name, 2), Albot1Batch)
    for made in (batch, make_mappers("albot1", 2)):
        assert isinstance(made, MapperBatch)
        assert made.poses.shape == (2, 3)


def test_the_kernel_knows_where_each_network_looked_from() -> None:
    batch = Albot1Batch(1)
    np.testing.assert_array_equal(batch._robots.compared_from[0], batch.network(0).compared_from)
