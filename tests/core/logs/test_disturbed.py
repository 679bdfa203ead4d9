"""Disturbed logs differ from what was recorded as their names say, and in nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.logs.disturbed import (
    DISTURBANCES,
    LARGEST_TURN_ERROR,
    LONGEST,
    NEAR,
    SHORTEST,
    disturbed,
    with_a_fine_laser,
    with_faults,
)
from albot_core.logs.log import Log
from albot_core.sensing.faults.fault import Clock
from albot_core.sensing.faults.injector import FaultInjector
from albot_core.sensing.faults.registry import READING_FAULTS, parse_faults
from albot_core.sensing.reading import LaserGeometry


@pytest.fixture(scope="module")
def log() -> Log:
    """A walk of 600 steps of a metre with a laser of 9 beams."""
    rng = np.random.default_rng(0)
    headings = np.cumsum(rng.uniform(-0.2, 0.2, 600))
    steps = np.stack((np.cos(headings), np.sin(headings)), axis=-1)
    odometry = np.column_stack((np.cumsum(steps, axis=0), headings))
    return Log(
        name="walk",
        geometry=LaserGeometry(beams=9, spacing=np.pi / 8),
        stamps=np.arange(600.0),
        ranges=rng.uniform(1.0, 20.0, (600, 9)),
        odometry=odometry,
        reference=odometry.copy(),
    )


def motions(log: Log) -> np.ndarray:
    """What the odometer says of each step."""
    return relative(log.odometry[:-1], log.odometry[1:])


def test_turns_are_off_by_heavy_tails_within_their_bound(log: Log) -> None:
    worse = DISTURBANCES["turns"](log, np.random.default_rng(1))
    errors = motions(worse)[:, 2] - motions(log)[:, 2]
    assert np.abs(errors).max() <= LARGEST_TURN_ERROR + 1e-9
    assert 0.01 < (np.abs(errors) > np.radians(20.0)).mean() < 0.08  # 3.8 % by Student's t
    assert np.degrees(np.median(np.abs(errors))) == pytest.approx(4.0 * 0.816, rel=0.2)
    assert motions(worse)[:, :2] == pytest.approx(motions(log)[:, :2], abs=1e-9)


def test_lengths_are_off_by_a_factor_each(log: Log) -> None:
    worse = DISTURBANCES["lengths"](log, np.random.default_rng(1))
    factors = np.hypot(*motions(worse)[:, :2].T) / np.hypot(*motions(log)[:, :2].T)
    assert SHORTEST <= factors.min() < 0.87 and 1.13 < factors.max() <= LONGEST
    assert motions(worse)[:, 2] == pytest.approx(motions(log)[:, 2], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_every_second_beam_points_where_it_did(log: Log, seed: int) -> None:
    worse = DISTURBANCES["beams"](log, np.random.default_rng(seed))
    assert log.geometry is not None and worse.geometry is not None
    assert log.ranges is not None and worse.ranges is not None
    which = np.abs(log.geometry.bearings[:, None] - worse.geometry.bearings).argmin(axis=0)
    assert worse.geometry.bearings == pytest.approx(log.geometry.bearings[which])
    assert np.array_equal(worse.ranges, log.ranges[:, which])
    assert worse.geometry.beams in (4, 5)


def test_every_third_reading_goes_with_all_that_is_of_it(log: Log) -> None:
    worse = DISTURBANCES["views"](log, np.random.default_rng(1))
    kept = np.isin(log.stamps, worse.stamps)
    assert kept.sum() == 400 and set(np.diff(np.flatnonzero(~kept))) == {3}
    assert log.ranges is not None
    assert np.array_equal(worse.ranges, log.ranges[kept])
    assert np.array_equal(worse.odometry, log.odometry[kept])
    assert np.array_equal(worse.reference, log.reference[kept])


def test_a_near_sighted_laser_sees_nothing_farther(log: Log) -> None:
    worse = DISTURBANCES["range"](log, np.random.default_rng(1))
    assert log.ranges is not None and worse.ranges is not None
    far = log.ranges >= NEAR
    assert np.isinf(worse.ranges[far]).all()
    assert np.array_equal(worse.ranges[~far], log.ranges[~far])


@pytest.mark.parametrize("disturbance", DISTURBANCES)
def test_a_seed_is_a_log(log: Log, disturbance: str) -> None:
    one, same, other = (disturbed(log, disturbance, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.odometry, same.odometry) and np.array_equal(one.ranges, same.ranges)
    if disturbance != "frozen":
        assert not np.array_equal(one.odometry[-1], other.odometry[-1])
    assert not np.array_equal(one.ranges, other.ranges)


@pytest.mark.parametrize("name", sorted(set(READING_FAULTS) - {"saturated-sonars", "wheel-slip"}))
def test_faults_strike_logs_as_they_strike_robots(log: Log, name: str) -> None:
    spec = f"{name}:at={float(log.times[5] - log.times[0])!r}s"
    worse, same = (with_faults(log, spec, 3) for _ in range(2))
    assert np.array_equal(worse.odometry, same.odometry)
    assert worse.ranges is not None and log.ranges is not None
    assert np.array_equal(worse.ranges, same.ranges)
    assert np.array_equal(worse.ranges[:5], log.ranges[:5])
    np.testing.assert_allclose(worse.odometry[:5], log.odometry[:5], atol=1e-9)
    assert len(worse.stamps) == len(worse.odometry) == len(worse.ranges)
    faults = parse_faults(spec, READING_FAULTS)
    injector = FaultInjector(faults, (3,), log.geometry, log.sonar)  # type: ignore[arg-type]
    travelled, arrived = 0.0, []
    for reading in log.recorded_readings:
        travelled += float(np.hypot(*reading.motion[:2]))
        arrived += injector.feed(reading, Clock(reading.stamp - log.times[0], travelled))
    assert worse.stamps.tolist() == [reading.stamp for reading in arrived]
    scans = [reading.laser.ranges for reading in arrived if reading.laser is not None]
    assert np.array_equal(worse.ranges, scans)
    np.testing.assert_allclose(
        relative(worse.odometry[:-1], worse.odometry[1:]),
        [reading.motion for reading in arrived[1:]],
        atol=1e-9,
    )


def test_a_log_without_what_a_fault_needs_is_refused(log: Log) -> None:
    with pytest.raises(InputError, match="sonar, which saturated-sonars needs"):
        with_faults(log, "saturated-sonars", 1)
    with pytest.raises(InputError, match="contact, which wheel-slip needs"):
        disturbed(log, "wheel-slip", 1)
    with pytest.raises(InputError, match="faults among laser-dropout"):
        disturbed(log, "kidnap", 1)


@pytest.mark.parametrize("disturbance", ["beams", "range"])
def test_a_log_without_a_laser_is_refused(log: Log, disturbance: str) -> None:
    blind = Log(name="blind", geometry=None, stamps=log.stamps, ranges=None, odometry=log.odometry)
    with pytest.raises(InputError, match="blind: expected a laser"):
        disturbed(blind, disturbance, 1)


def test_a_beam_between_two_lies_on_their_wall() -> None:
    # A wall 2 m ahead, and to the left of it another, 3 m farther.
    geometry = LaserGeometry(beams=5, spacing=np.radians(2.0), first_bearing=-np.radians(4.0))
    wall = 2.0 / np.cos(geometry.bearings)
    ranges = np.tile(np.where(np.arange(5) < 3, wall, wall + 3.0), (2, 1))
    log = Log(
        name="wall",
        geometry=geometry,
        stamps=np.arange(2.0),
        ranges=ranges,
        odometry=np.zeros((2, 3)),
    )
    fine = with_a_fine_laser(log, np.random.default_rng(0))
    assert fine.geometry is not None and fine.ranges is not None
    assert fine.geometry.beams == 9
    assert fine.geometry.bearings[::2] == pytest.approx(geometry.bearings)
    on_wall = 2.0 / np.cos(fine.geometry.bearings)
    assert fine.ranges[0, :5] == pytest.approx(on_wall[:5])
    assert fine.ranges[0, 5] == fine.ranges[0, 4]  # At the break it is that of the nearer wall.
    mirrored = replace(log, ranges=ranges[:, ::-1])
    fine = with_a_fine_laser(mirrored, np.random.default_rng(0))
    assert fine.ranges is not None
    assert fine.ranges[0, 3] == fine.ranges[0, 4]


def test_a_beam_between_two_lies_on_a_wall_that_runs_away() -> None:
    # A wall 1 m to the right, met at 80° first and at 4° last. The seventh beam sees past a door.
    geometry = LaserGeometry(beams=20, spacing=np.radians(4.0), first_bearing=np.radians(-80.0))
    wall = -1.0 / np.sin(geometry.bearings)
    ranges = np.tile(np.where(np.arange(20) == 6, 9.0, wall), (2, 1))
    stamps, odometry = np.arange(2.0), np.zeros((2, 3))
    log = Log(name="wall", geometry=geometry, stamps=stamps, ranges=ranges, odometry=odometry)
    fine = with_a_fine_laser(log, np.random.default_rng(0))
    assert fine.geometry is not None and fine.ranges is not None
    expected = -1.0 / np.sin(fine.geometry.bearings)
    expected[11:14] = wall[5], 9.0, wall[7]
    # Between the last two, whose ranges differ by 7 m, no third point tells that they are one wall.
    expected[37] = wall[18]
    np.testing.assert_allclose(fine.ranges[0], expected)


def test_a_frozen_odometer_reports_no_motion(log: Log) -> None:
    assert not log.is_odometry_constant
    assert disturbed(log, "frozen", 0).is_odometry_constant
