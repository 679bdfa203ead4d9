"""Landmarks in scans of a room whose corners are known."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points
from albot_core.mappers.slam.line_ends import LineEndConfig, find_line_ends
from albot_core.sensing.reading import LaserGeometry, LaserScan
from tests.core.mappers.slam.rooms import CORRIDOR, LASER, ROOM, scan_from

CORNERS = np.array(((-4, -3), (5, -3), (5, 4), (-4, 4), (1, 4), (1, 2.5)), float)
"""The room's corners, where the stub meets the wall, and the stub's free end."""
ROUND = LaserGeometry(beams=720, first_bearing=-np.pi, spacing=np.pi / 360)
FINE = LaserGeometry(beams=721, first_bearing=-np.pi / 2, spacing=np.pi / 720)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (-2.0, 1.0, 2.0), (3.0, -1.0, -2.5)])
def test_corners_and_free_ends_are_found_where_they_are(pose):
    found = find_line_ends(scan_from(np.array(pose), laser=ROUND), LineEndConfig())
    points = transform_points(np.array(pose), found[:, :2])
    away = np.hypot(*(points[:, None] - CORNERS).transpose(2, 0, 1))
    assert away.min(axis=1).max() < 0.05
    # All that are in view: the corner behind the stub may be hidden.
    assert (away.min(axis=0) < 0.05).sum() >= 5
    assert away.min(axis=0)[5] < 0.05


def test_each_is_found_once():
    found = find_line_ends(scan_from(np.zeros(3), laser=ROUND), LineEndConfig())
    apart = np.hypot(*(found[:, None, :2] - found[None, :, :2]).transpose(2, 0, 1))
    assert (apart + np.eye(len(found))).min() > 0.3


def test_a_free_end_lies_in_the_gap_between_two_beams_and_its_error_is_that_gap():
    """Over many places the end's errors are those that its covariance gives."""
    rng, squares = np.random.default_rng(0), []
    config = LineEndConfig(noise=1e-3, bearing_noise=0.0)
    for _ in range(200):
        pose = np.array((rng.uniform(-2, -1), rng.uniform(-1, 1), rng.uniform(0.2, 0.8)))
        found = find_line_ends(scan_from(pose), config)
        points = transform_points(pose, found[:, :2])
        nearest = int(np.argmin(np.hypot(*(points - (1.0, 2.5)).T)))
        error = (points[nearest] - (1.0, 2.5)) @ np.array((0.0, 1.0))
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        _, _, xx, xy, yy = found[nearest]
        variance = sin * sin * xx + 2 * sin * cos * xy + cos * cos * yy
        squares.append(error**2 / variance)
    assert 0.7 < np.mean(squares) < 1.5


def test_the_bearings_error_lies_across_the_beam():
    config = LineEndConfig(noise=0.01, bearing_noise=0.1)
    found = find_line_ends(scan_from(np.zeros(3), laser=ROUND), config)
    corner = found[np.argmin(np.hypot(*(found[:, :2] - (5.0, 4.0)).T))]
    spread = np.array(((corner[2], corner[3]), (corner[3], corner[4])))
    along = corner[:2] / np.hypot(*corner[:2])
    across = np.array((-along[1], along[0]))
    assert along @ spread @ along == pytest.approx(0.01**2)
    assert across @ spread @ across == pytest.approx(0.01**2 + 0.01 * (25 + 16), rel=0.01)


def test_the_lasers_place_on_the_robot_counts():
    mounted = LaserGeometry(beams=181, mount=(0.3, -0.2, 0.4))
    pose = np.array((-1.0, 0.5, 0.3))
    found = find_line_ends(scan_from(pose, laser=mounted), LineEndConfig())
    points = transform_points(pose, found[:, :2])
    away = np.hypot(*(points[:, None] - CORNERS).transpose(2, 0, 1))
    assert len(found) >= 2
    assert away.min(axis=1).max() < 0.1


@pytest.mark.parametrize("ranges", [np.inf, 0.0, LASER.max_range])
def test_no_returns_have_no_landmarks(ranges):
    scan = LaserScan(ranges=np.full(LASER.beams, ranges), geometry=LASER)
    assert find_line_ends(scan, LineEndConfig()).shape == (0, 5)


def test_a_corridor_has_none():
    found = find_line_ends(scan_from(np.zeros(3), CORRIDOR), LineEndConfig())
    assert found.shape == (0, 5)


def test_far_and_short_ones_are_left_out():
    scan = scan_from(np.zeros(3), ROOM, ROUND)
    near = find_line_ends(scan, LineEndConfig(reach=4.9))
    assert 0 < len(near) < len(find_line_ends(scan, LineEndConfig()))
    assert np.hypot(*near[:, :2].T).max() < 5.0
    assert len(find_line_ends(scan, LineEndConfig(least_length=20.0))) == 0


def test_a_wall_that_bends_a_little_has_no_corner_there():
    """A wall ahead that bends by 25°: a corner only where such a bend counts as one."""
    out = 4.0 * np.array((np.sin(np.radians(12.5)), np.cos(np.radians(12.5))))
    walls = np.array(((3 + out[0], -out[1], 3, 0), (3, 0, 3 + out[0], out[1])), float)
    scan = scan_from(np.zeros(3), walls)

    def at_bend(angle: float) -> int:
        found = find_line_ends(scan, LineEndConfig(least_angle=np.radians(angle)))
        return int((np.hypot(*(found[:, :2] - (3.0, 0.0)).T) < 0.1).sum())

    assert at_bend(30.0) == 0
    assert at_bend(20.0) == 1


@pytest.mark.parametrize("wrong", [{"reach": 0.0}, {"noise": 0.0}, {"least_angle": -1.0}])
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(InputError, match=f"LineEndConfig.{next(iter(wrong))}"):
        LineEndConfig(**wrong)
