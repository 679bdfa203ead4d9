"""Scans become points; what is no scan is refused."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    Readings,
    SonarGeometry,
    SonarScan,
)


def scan_of(ranges: list[float], **geometry: object) -> LaserScan:
    return LaserScan(
        ranges=np.array(ranges),
        geometry=LaserGeometry(beams=len(ranges), **geometry),  # type: ignore[arg-type]
    )


def test_points_stand_in_the_robots_frame() -> None:
    scan = scan_of(
        [1.0, 2.0, np.inf], first_bearing=-np.pi / 2, spacing=np.pi / 2, mount=(0.25, 0.0, 0.0)
    )
    assert np.allclose(scan.points, [[0.25, -1.0], [2.25, 0.0]])


def test_a_turned_mount_turns_the_points() -> None:
    scan = scan_of([1.0, 1.0], first_bearing=0.0, spacing=0.1, mount=(0.0, 0.0, np.pi / 2))
    assert np.allclose(scan.points[0], [0.0, 1.0])


def test_the_last_beam_of_the_default_points_left() -> None:
    geometry = LaserGeometry()
    assert geometry.bearings[-1] == pytest.approx(np.pi / 2)
    assert np.allclose(geometry.directions[-1], [0.0, 1.0])


@pytest.mark.parametrize("bad", [float("nan"), -1.0])
def test_ranges_that_are_no_distances_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="at beam 1"):
        scan_of([1.0, bad, 2.0])


def test_a_wrong_beam_count_is_refused() -> None:
    with pytest.raises(InputError, match="181 ranges"):
        LaserScan(ranges=np.ones(180), geometry=LaserGeometry())


def test_motion_must_be_finite() -> None:
    with pytest.raises(InputError, match="three finite numbers"):
        Reading(stamp=0.0, motion=np.array([0.0, np.nan, 0.0]), laser=scan_of([1.0, 1.0]))


@pytest.mark.parametrize("wrong", [[1.0, 2.0, 3.0], None, "abc", np.array(["1", "2", "3"])])
def test_what_is_no_array_of_numbers_is_refused(wrong: Any) -> None:
    def make(kind: type, **given: Any) -> None:
        # Users' types are not checked as those of the tests are.
        inspect.unwrap(kind.__init__)(object.__new__(kind), **given)

    three = SonarGeometry(bearings=(0.0, 0.1, 0.2), places=((0.0, 0.0),) * 3)
    with pytest.raises(InputError, match=r"^LaserScan\.ranges: expected an array of 3 ranges"):
        make(LaserScan, ranges=wrong, geometry=LaserGeometry(beams=3))
    with pytest.raises(InputError, match=r"^SonarScan\.ranges: expected an array of 3 ranges"):
        make(SonarScan, ranges=wrong, geometry=three)
    with pytest.raises(InputError, match=r"^Reading\.motion: expected an array of 3 numbers"):
        make(Reading, stamp=0.0, motion=wrong, laser=None, sonar=None, scene=None)


IMPOSSIBLE: list[dict[str, object]] = [
    {"beams": 1}, {"spacing": 0.0}, {"max_range": np.inf},
    {"first_bearing": np.nan}, {"beam_width": -0.01}, {"mount": (np.nan, 0.0, 0.0)},
]  # fmt: skip


@pytest.mark.parametrize("wrong", IMPOSSIBLE)
def test_impossible_geometry_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        LaserGeometry(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("heading", [np.nan, np.inf])
def test_a_compass_shows_a_finite_heading(heading: float) -> None:
    with pytest.raises(InputError, match=r"Reading.compass: expected a finite heading"):
        Reading(stamp=0.0, motion=np.zeros(3), compass=heading)


def test_who_needs_a_compass_is_told_that_there_is_none() -> None:
    reading = Reading(stamp=0.0, motion=np.zeros(3), compass=0.5)
    assert reading.required_compass("a test") == 0.5
    with pytest.raises(InputError, match=r"a compass, which a test needs, found none"):
        Reading(stamp=0.0, motion=np.zeros(3)).required_compass("a test")


def test_each_robot_has_its_own_compass() -> None:
    readings = Readings(
        stamps=np.zeros(2), motions=np.zeros((2, 3)), compasses=np.array((0.25, -3.0))
    )
    assert [readings[row].compass for row in range(2)] == [0.25, -3.0]
    assert Readings(stamps=np.zeros(2), motions=np.zeros((2, 3)))[0].compass is None
