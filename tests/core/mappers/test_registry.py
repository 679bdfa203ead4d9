"""What every mapper must keep to, and how they are found."""

from __future__ import annotations

import subprocess
import sys
from multiprocessing.reduction import ForkingPickler

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import MAPPERS, make_mapper, mapper_names
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading

RNG = np.random.default_rng(0)

LASER = LaserGeometry()


def readings(count: int = 12) -> list[Reading]:
    """A robot driving down the middle of a corridor with niches, 2 m wide."""
    scans = []
    for k in range(count):
        side = 1.0 / np.maximum(np.abs(np.sin(LASER.bearings)), 1e-6)
        along = side * np.cos(LASER.bearings) + 0.4 * k
        ranges = np.where(np.floor(along) % 3 == 0, 1.6 * side, side)
        end = (12.0 - 0.4 * k) / np.maximum(np.cos(LASER.bearings), 1e-6)
        ranges = np.minimum(ranges, end)
        motion = np.array((0.4 if k else 0.0, 0.0, 0.0))
        scan = LaserScan(ranges=ranges, geometry=LASER)
        scans.append(Reading(stamp=float(k), motion=motion, laser=scan))
    return scans


@pytest.fixture(params=mapper_names())
def name(request):
    return request.param


def test_the_names():
    assert mapper_names() == ("albot1", "albot1-thesis", "odometry")
    assert all(name == entry.name for name, entry in MAPPERS.items())
    assert all(entry.summary.endswith(".") and entry.paper for entry in MAPPERS.values())


@pytest.mark.parametrize(
    ("typed", "meant"), [("albot", "albot1"), ("Odometry", "odometry"), ("albot1-teses", "thesis")]
)
def test_a_mistyped_name_is_guessed(typed, meant):
    with pytest.raises(InputError, match=f"did you mean .*{meant}"):
        make_mapper(typed)


def test_a_name_like_none():
    with pytest.raises(InputError, match=r"one of albot1, albot1-thesis, odometry, found 'xyz'$"):
        make_mapper("xyz")


def test_no_mapper_is_imported_before_it_is_made():
    code = (
        "import sys, albot_core.mappers.registry as r; r.mapper_names(); "
        "sys.exit(any('numba' in name or 'albot1.' in name for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_fresh_mapper_is_at_home(name):
    mapper = make_mapper(name)
    assert isinstance(mapper, Mapper)
    assert mapper.spec.name == name
    assert mapper.estimate.map_version == 0
    assert mapper.snapshot().segments.shape == (0, 4)
    np.testing.assert_array_equal(mapper.estimate.pose, np.zeros(3))
    np.testing.assert_array_equal(mapper.estimate.home_from_robot, np.zeros(3))


def test_the_motion_of_the_first_reading_is_ignored(name):
    still, moved = make_mapper(name), make_mapper(name)
    first = readings(1)[0]
    still.update(first)
    moved.update(Reading(stamp=0.0, motion=np.array((3.0, 2.0, 1.0)), laser=first.laser))
    np.testing.assert_array_equal(moved.estimate.pose, still.estimate.pose)
    np.testing.assert_array_equal(moved.snapshot().segments, still.snapshot().segments)


def test_a_mapper_counts_its_updates_and_sees_walls(name):
    mapper = make_mapper(name)
    laid = sum(mapper.update(reading) for reading in readings())
    assert mapper.estimate.map_version == laid >= 1
    assert mapper.snapshot().segments.shape[1] == 4
    assert len(mapper.snapshot().segments) >= 2
    assert np.isfinite(mapper.snapshot().segments).all()
    # The corridor's walls lie a metre, its niches 1.6 m, to either side.
    assert np.abs(mapper.snapshot().segments[:, [1, 3]]).max() < 1.8
    # Inexact mappers are a step off at most.
    np.testing.assert_allclose(mapper.estimate.pose, (4.4, 0, 0), atol=0.3)
    np.testing.assert_allclose(mapper.estimate.home_from_robot, (-4.4, 0, 0), atol=0.3)


def test_two_mappers_of_a_name_agree_to_the_last_bit(name):
    one, other = make_mapper(name), make_mapper(name)
    for reading in readings():
        one.update(reading)
        other.update(reading)
    for key, array in one.state().items():
        np.testing.assert_array_equal(array, other.state()[key])


def test_reset_makes_a_mapper_new(name):
    mapper, fresh = make_mapper(name), make_mapper(name)
    for reading in readings():
        mapper.update(reading)
    mapper.reset(RNG)
    assert mapper.estimate.map_version == 0
    for reading in readings():
        mapper.update(reading)
        fresh.update(reading)
    np.testing.assert_array_equal(mapper.estimate.pose, fresh.estimate.pose)
    np.testing.assert_array_equal(mapper.snapshot().segments, fresh.snapshot().segments)


def test_the_readings_are_left_as_they_were(name):
    mapper = make_mapper(name)
    for reading in readings():
        ranges, motion = reading.laser.ranges.copy(), reading.motion.copy()
        mapper.update(reading)
        np.testing.assert_array_equal(reading.laser.ranges, ranges)
        np.testing.assert_array_equal(reading.motion, motion)


@pytest.mark.parametrize("name", mapper_names())
def test_a_mapper_goes_to_another_process(name: str) -> None:
    mapper = make_mapper(name)
    twin = ForkingPickler.loads(ForkingPickler.dumps(mapper))
    assert type(twin) is type(mapper)
    np.testing.assert_array_equal(twin.estimate.pose, mapper.estimate.pose)
