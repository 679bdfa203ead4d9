"""The occupancy grid: ways on open ground and round a wall, and where to look ahead along them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from albot_core.planning.occupancy_grid import MAX_STRAIGHT, NEAR_BY, OccupancyGrid
from albot_core.planning.percept import Percept
from tests.core.mappers.slam.rooms import LASER, scan_from

HOME = np.zeros(3)
CELL = OccupancyGrid().cell


def _line(start: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    """Points on the way to `end`, which is left out, as far apart as cells."""
    count = round(np.hypot(*np.subtract(end, start)) / CELL)
    return np.linspace(start, end, count, endpoint=False)


@pytest.mark.parametrize("length", [1.5, 5.0])
def test_on_open_ground_it_looks_as_far_ahead_as_it_drives_straight(length: float) -> None:
    grid, goal = OccupancyGrid(), np.array((0.0, -length))
    paths = grid.shortest_paths(HOME, unknown_is_free=True)
    assert grid.length(paths, goal) == pytest.approx(length - NEAR_BY, abs=CELL)
    route = grid.route(paths, goal)
    np.testing.assert_allclose(route[[0, -1]], ((0, 0), (0, NEAR_BY - length)), atol=CELL)
    ahead = grid.lookahead_point(HOME, route, unknown_is_free=True)
    np.testing.assert_allclose(ahead, (0, -min(length - NEAR_BY, MAX_STRAIGHT)), atol=2 * CELL)


def test_round_a_wall_it_looks_no_farther_than_the_wall_allows() -> None:
    """The way leads round the stub of the room's upper wall, which ends at (1, 2.5)."""
    grid, robot, end = OccupancyGrid(), np.array((0.0, 3.5, 0.0)), np.array((1.0, 2.5))
    ranges = np.minimum(scan_from(robot).ranges, LASER.max_range)
    grid.integrate(Percept(ranges=ranges, laser=LASER, pose=robot, motion=HOME))
    corners = ((0, 3.5), (0, 1.5), (2, 1.5), (2, 3.5))
    route = np.concatenate([_line(*pair) for pair in itertools.pairwise(corners)])
    ahead = grid.lookahead_point(robot, route, unknown_is_free=True)
    assert ahead[1] == pytest.approx(1.5)
    assert 0.3 < ahead[0] < 1.5
    x, y = (ahead - robot[:2]) / np.hypot(*(ahead - robot[:2]))
    to_wall = end - robot[:2]
    assert abs(x * to_wall[1] - y * to_wall[0]) > 0.28 - CELL


def test_without_a_way_it_looks_where_it_is() -> None:
    grid, pose = OccupancyGrid(), np.array((1.0, 2.0, 0.5))
    np.testing.assert_array_equal(grid.lookahead_point(pose, np.empty((0, 2))), pose[:2])
