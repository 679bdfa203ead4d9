"""The explorer of nearest frontiers: the frontiers of grids drawn by hand, and end to end."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.planning.frontier_explorer import find_frontiers
from albot_core.planning.grid_search import BLOCKED, FREE
from albot_maps import World
from tests.agents.test_gap_explorer import _explore


def _room() -> tuple[np.ndarray, np.ndarray]:
    """A room of 10 × 10 cells, walled but for a door of 4 cells to the right, and all covered."""
    grid = np.zeros((20, 20), np.int8)
    grid[4:16, 4:16] = BLOCKED
    grid[5:15, 5:15] = FREE
    grid[8:12, 15] = FREE
    return grid, grid == FREE


def test_the_frontier_of_a_room_is_its_door() -> None:
    grid, covered = _room()
    found = find_frontiers(grid, covered, 4)
    door = np.zeros(grid.shape, bool)
    door[8:12, 15] = True
    assert np.array_equal(found > 0, door)
    assert len(np.unique(found[door])) == 1


def test_a_gap_that_is_narrower_than_wanted_is_no_frontier() -> None:
    grid, covered = _room()
    assert not find_frontiers(grid, covered, 5).any()


def test_ground_seen_from_afar_is_beyond_the_frontier() -> None:
    """Free ground that is not covered yet, half the room: the frontier is the line between."""
    grid, covered = _room()
    covered[:, 10:] = False
    found = find_frontiers(grid, covered, 4)
    assert np.argwhere(found).tolist() == [[row, 9] for row in range(5, 15)]


def test_separate_frontiers_have_numbers_of_their_own() -> None:
    grid, covered = _room()
    grid[8:12, 4], covered[8:12, 4] = FREE, True
    found = find_frontiers(grid, covered, 4)
    assert found[8:12, 4].min() == found[8:12, 4].max() != found[8, 15]
    assert (found > 0).sum() == 8


def test_it_covers_two_rooms_and_touches_nothing(two_rooms: World) -> None:
    info = _explore(two_rooms, 400, 1, mapper="odometry", agent="nearest-frontier")
    assert info["coverage"] > 0.95
    assert info["rooms_entered"] == 2
    assert info["contacts"] == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_it_goes_on_in_the_office(seed: int) -> None:
    info = _explore("office-ring", 600, seed, mapper="none", agent="nearest-frontier")
    assert info["coverage"] > 0.1
    assert info["contacts"] == 0
