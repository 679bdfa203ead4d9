"""How far a disc gets straight on, past a single obstacle beside its way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.planning.grid_search import BLOCKED, FREE, UNKNOWN
from albot_core.planning.occupancy_grid_kernels import farthest_straight

RADIUS = 3.0
"""The disc's radius (cells)."""
START, PASSED, END = 5, 25, 35
"""Where along its row the way begins, passes the obstacle, and ends."""


def _farthest(grid: np.ndarray, *, unknown_is_free: bool = False) -> int:
    """How far along its row the way is straight; of a grid where nothing is near the start."""
    along = np.arange(START, END + 1)
    cells = np.stack((np.full_like(along, 20), along), axis=1)
    place, limits, radii = (20.5, START + 0.5), (0.0, 1000.0), (RADIUS, RADIUS)
    return START + farthest_straight(grid, place, cells, limits, radii, unknown_is_free)


@pytest.mark.parametrize("aside", range(-5, 6))
def test_an_obstacle_is_in_the_way_if_it_is_within_the_radius(aside: int) -> None:
    grid = np.full((41, 41), FREE, np.int8)
    grid[20 + aside, PASSED] = BLOCKED
    expected = END
    if abs(aside) <= RADIUS:
        # The last cell that is more than the radius away from it.
        expected = PASSED - math.floor(math.sqrt(RADIUS**2 - aside**2)) - 1
    assert _farthest(grid) == expected


@pytest.mark.parametrize("unknown_is_free", [False, True])
def test_unknown_ground_is_in_the_way_unless_it_counts_as_free(unknown_is_free: bool) -> None:
    grid = np.full((41, 41), FREE, np.int8)
    grid[20, PASSED] = grid[19, PASSED - 3] = UNKNOWN  # The other one is beside the way.
    expected = END if unknown_is_free else PASSED - 1
    assert _farthest(grid, unknown_is_free=unknown_is_free) == expected
