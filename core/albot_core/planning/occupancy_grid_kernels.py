"""Compiled loops of the occupancy grid: marking scans, straight lines, uncovered ground."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import BLOCKED, FREE, UNKNOWN


@kernel()
def mark_scan(
    grid: np.ndarray,
    cell: float,
    sensor_pose: np.ndarray,
    ranges: np.ndarray,
    bearings: np.ndarray,
    reach: float,
) -> None:
    """Mark the cells along the beams free, and the cells at their ends blocked.

    `sensor_pose` is the laser's pose in the map's frame. Cells are marked up to `reach` (m), and
    all of them must be on the grid.
    """
    half = grid.shape[0] // 2
    # Positive, so int() rounds down.
    x, y = sensor_pose[0] / cell + half, sensor_pose[1] / cell + half
    for k in range(ranges.shape[0]):
        angle = sensor_pose[2] + bearings[k]
        dx, dy = np.cos(angle), np.sin(angle)
        steps = int(min(ranges[k] - cell, reach) / cell)
        for j in range(steps + 1):
            grid[int(y + j * dy), int(x + j * dx)] = FREE
    for k in range(ranges.shape[0]):  # Last, so that a grazing beam does not erase a wall.
        if ranges[k] < reach:
            angle, length = sensor_pose[2] + bearings[k], ranges[k] / cell
            grid[int(y + length * np.sin(angle)), int(x + length * np.cos(angle))] = BLOCKED


@kernel()
def mark_covered(
    covered: np.ndarray,
    cell: float,
    sensor_pose: np.ndarray,
    ranges: np.ndarray,
    bearings: np.ndarray,
    coverage_range: float,
) -> None:
    """Mark the cells along the beams as covered, up to `coverage_range` (m). See `mark_scan`."""
    half = covered.shape[0] // 2
    x, y = sensor_pose[0] / cell + half, sensor_pose[1] / cell + half
    for k in range(ranges.shape[0]):
        angle = sensor_pose[2] + bearings[k]
        dx, dy = np.cos(angle), np.sin(angle)
        for j in range(int(min(ranges[k] - cell, coverage_range) / cell) + 1):
            covered[int(y + j * dy), int(x + j * dx)] = True


@kernel(arrays=True)
def farthest_straight(
    grid: np.ndarray,
    place: tuple[float, float],
    cells: np.ndarray,
    straight_limits: tuple[float, float],
    radii: tuple[float, float],
    unknown_is_free: bool,
) -> int:
    """Return the index of the last of a route's `cells` that a disc reaches straight from `place`.

    The first attempt uses a disc of the second radius and cells at least as far away as the first
    limit. If no cell fits, the second attempt uses a disc of the first radius. Cells must be closer
    than the second limit. All lengths are in cells. Only the route beyond its cell nearest to the
    place is considered. If no cell can be reached straight, the result is the second cell after
    that nearest cell.
    """
    start = int(place[0]), int(place[1])
    count = cells.shape[0]
    away = np.empty(count)
    for k in range(count):
        away[k] = length_of(cells[k, 0] + 0.5 - place[0], cells[k, 1] + 0.5 - place[1])
    here = int(np.argmin(away))
    for radius, least in ((radii[1], straight_limits[0]), (radii[0], 0.0)):
        for k in range(count - 1, here - 1, -1):
            end = cells[k, 0], cells[k, 1]
            seen = least <= away[k] < straight_limits[1]
            if seen and straight_is_free(grid, start, end, radius, unknown_is_free):
                return k
    return int(min(here + 2, count - 1))


@kernel()
def straight_is_free(
    grid: np.ndarray,
    start: tuple[int, int],
    end: tuple[int, int],
    radius: float,
    unknown_is_free: bool,
) -> bool:
    """Return whether a disc can move straight from cell to cell.

    Near the start only blocked cells are obstacles, as in `search_grid`.
    """
    rows, columns = end[0] - start[0], end[1] - start[1]
    count = max(abs(rows), abs(columns))
    for k in range(1, count + 1):
        row = start[0] + int(np.round(rows * k / count))
        column = start[1] + int(np.round(columns * k / count))
        near = (row - start[0]) ** 2 + (column - start[1]) ** 2 <= (radius + 1) ** 2
        if near:
            if grid[row, column] == BLOCKED:
                return False
        elif not _passable(grid, row, column, radius, unknown_is_free):
            return False
    return True


@kernel()
def _passable(
    grid: np.ndarray, row: int, column: int, radius: float, unknown_is_free: bool
) -> bool:
    """Return whether a cell is free and no blocked cell's centre lies in the disc around it.

    With `unknown_is_free`, unknown cells count as free.
    """
    if grid[row, column] == BLOCKED or (grid[row, column] == UNKNOWN and not unknown_is_free):
        return False
    around = int(radius)
    for i in range(-around, around + 1):
        for j in range(-around, around + 1):
            if i * i + j * j <= radius * radius and grid[row + i, column + j] == BLOCKED:
                return False
    return True


@kernel(arrays=True)
def blocked_around(grid: np.ndarray, row: int, column: int, around: int) -> np.ndarray:
    """Return rows and columns (n, 2) of the blocked cells in a square around a cell."""
    found = np.empty(((2 * around + 1) ** 2, 2), np.int64)
    count = 0
    for r in range(max(0, row - around), min(grid.shape[0], row + around + 1)):
        for c in range(max(0, column - around), min(grid.shape[1], column + around + 1)):
            if grid[r, c] == BLOCKED:
                found[count, 0], found[count, 1] = r, c
                count += 1
    return found[:count]


@kernel(arrays=True)
def uncovered_shares(
    grid: np.ndarray, covered: np.ndarray, cells: np.ndarray, around: int
) -> np.ndarray:
    """Return the share (n,) of a square around each cell that is neither covered nor blocked.

    It is 0 for cells that are covered or blocked themselves. Cells beyond the grid's edges are
    neither.
    """
    shares = np.empty(cells.shape[0])
    for k in range(cells.shape[0]):
        row, column = cells[k, 0], cells[k, 1]
        inside = 0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]
        if inside and (covered[row, column] or grid[row, column] == BLOCKED):
            shares[k] = 0.0
            continue
        done = 0
        for r in range(max(0, row - around), min(grid.shape[0], row + around + 1)):
            for c in range(max(0, column - around), min(grid.shape[1], column + around + 1)):
                done += covered[r, c] or grid[r, c] == BLOCKED
        shares[k] = 1 - done / (2 * around + 1) ** 2
    return shares
