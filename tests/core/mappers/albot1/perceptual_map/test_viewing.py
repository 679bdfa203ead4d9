"""When a scan is taken as a view: by the odometer, and where the odometer cannot be believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.geometry.poses import relative
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.sensing.reading import LaserScan, Reading
from tests.core.scenes import ROOM, scan_from

EVERY_READING = replace(Albot1Config(), view_spacing=0.0, view_turn=0.0)
STEP = 0.02
"""How far the robot goes from reading to reading (m)."""


def drive(mapper: Albot1, path: np.ndarray, reported: np.ndarray, noise: float = 0.01) -> list[int]:
    """Lead a mapper along a path (n, 3) with these motions; return the readings that were views."""
    rng, views = np.random.default_rng(0), []
    for k, (pose, motion) in enumerate(zip(path, reported, strict=True)):
        scan = scan_from(pose, ROOM)
        scan.ranges[:] += rng.normal(0.0, noise, len(scan.ranges))
        before = mapper.state()["progress"][0]
        mapper.update(Reading(stamp=float(k), motion=motion, laser=scan))
        if mapper.state()["progress"][0] > before:
            views.append(k)
    return views


def straight(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """A straight path in small steps, and its motions."""
    path = np.zeros((steps, 3))
    path[:, 0] = STEP * np.arange(steps) - 1.0
    motions = np.zeros((steps, 3))
    motions[1:] = relative(path[:-1], path[1:])
    return path, motions


def test_views_are_as_far_apart_as_the_spacing() -> None:
    mapper = Albot1(replace(Albot1Config(), view_spacing=0.1 - 1e-9, view_turn=1.0))
    # The first motion tells that there is an odometer; from then on five steps are 0.1 m.
    assert drive(mapper, *straight(32)) == [0, 1, 6, 11, 16, 21, 26, 31]


def test_a_turn_on_the_spot_makes_views_too() -> None:
    path = np.zeros((31, 3))
    path[:, 2] = np.radians(3.0) * np.arange(31)
    motions = np.zeros((31, 3))
    motions[1:, 2] = np.radians(3.0)
    mapper = Albot1(replace(Albot1Config(), view_turn=np.radians(15.0) - 1e-9))
    assert drive(mapper, path, motions) == [0, 1, 6, 11, 16, 21, 26]


def test_a_robot_that_stands_takes_no_views() -> None:
    path, motions = straight(30)
    path[10:], motions[10:] = path[9], 0.0
    views = drive(mapper := Albot1(), path, motions)
    # Where it comes to a stand it may look once more, for it has gone on since its last view.
    assert len(views) <= 3 and views[-1] <= 10
    assert np.hypot(*(mapper.estimate.pose[:2] - (9 * STEP, 0.0))) < 0.02


def test_without_an_odometer_every_reading_is_a_view() -> None:
    path, motions = straight(12)
    one, other = Albot1(), Albot1(EVERY_READING)
    assert drive(one, path, 0.0 * motions) == list(range(12))
    drive(other, path, 0.0 * motions)
    assert np.array_equal(one.estimate.pose, other.estimate.pose)


@pytest.mark.parametrize("dies_at", [20, 33])
def test_an_odometer_that_dies_does_not_blind_the_robot(dies_at: int) -> None:
    path, motions = straight(100)
    motions[dies_at:] = 0.0
    views = drive(mapper := Albot1(), path, motions)
    # It looks again as soon as the nearest wall ahead is another 0.1 m nearer.
    assert max(np.diff([view for view in views if view >= dies_at])) <= 0.1 / STEP + 2
    assert np.hypot(*(mapper.estimate.pose - relative(path[0], path[-1]))[:2]) < 0.15


def test_a_robot_carried_while_it_stands_looks_at_once() -> None:
    path, motions = straight(40)
    path[30:], motions[30:] = (1.5, 1.0, 2.0), 0.0
    views = drive(Albot1(), path, motions)
    assert 30 in views


def test_a_lost_echo_counts_as_change_and_nan_as_no_echo() -> None:
    path, motions = straight(4)
    mapper = Albot1()
    drive(mapper, path, motions)
    scan = scan_from(path[-1], ROOM)
    before = mapper.state()["progress"][0]
    for ranges in (scan.ranges, np.full_like(scan.ranges, np.inf)):
        blind = LaserScan(ranges=ranges, geometry=scan.geometry)
        mapper.update(Reading(stamp=9.0, motion=np.zeros(3), laser=blind))
    assert mapper.state()["progress"][0] == before + 1


def test_the_letter_goes_by_the_odometer_alone() -> None:
    thesis = Albot1(replace(Albot1Config.thesis(), view_spacing=0.1 - 1e-9, view_turn=1.0))
    path, motions = straight(40)
    motions[20:] = 0.0
    assert drive(thesis, path, motions) == [0, 5, 10, 15]
