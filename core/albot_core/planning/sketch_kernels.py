"""Compiled loops of the sketch. Meaning of the arrays: see `sketch`."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel

UNKNOWN, FREE, BLOCKED, WANTED = 0, 1, 2, 3
"""What cells are; wanted are those free ones of which any will do as the end of a way."""
STEP, ACROSS = 5, 7
"""Lengths of a step to a cell beside and to one across a corner: 7 is nearly 5 times √2."""
_LISTS = 32
"""More than a step adds at most to the length of a way with the least that is left of it."""


@kernel()
def draw_scan(
    grid: np.ndarray,
    cell: float,
    eye: np.ndarray,
    ranges: np.ndarray,
    bearings: np.ndarray,
    reach: float,
) -> None:
    """Mark the ground along the beams free, and blocked where they end.

    `eye` is the laser's pose in the map's frame. Ground is drawn up to the reach (m); all of that
    must be on the sheet.
    """
    half = grid.shape[0] // 2
    x, y = eye[0] / cell + half, eye[1] / cell + half  # Positive: to truncate is to floor.
    for k in range(ranges.shape[0]):
        angle = eye[2] + bearings[k]
        dx, dy = np.cos(angle), np.sin(angle)
        steps = int(min(ranges[k] - cell, reach) / cell)
        for j in range(steps + 1):
            grid[int(y + j * dy), int(x + j * dx)] = FREE
    for k in range(ranges.shape[0]):  # Ends last: a beam that grazes a wall must not erase it.
        if ranges[k] < reach:
            angle, length = eye[2] + bearings[k], ranges[k] / cell
            grid[int(y + length * np.sin(angle)), int(x + length * np.cos(angle))] = BLOCKED


@kernel()
def cover_scan(
    covered: np.ndarray,
    cell: float,
    eye: np.ndarray,
    ranges: np.ndarray,
    bearings: np.ndarray,
    near: float,
) -> None:
    """Mark the ground along the beams, as far as `near` (m), covered. See `draw_scan`."""
    half = covered.shape[0] // 2
    x, y = eye[0] / cell + half, eye[1] / cell + half
    for k in range(ranges.shape[0]):
        angle = eye[2] + bearings[k]
        dx, dy = np.cos(angle), np.sin(angle)
        for j in range(int(min(ranges[k] - cell, near) / cell) + 1):
            covered[int(y + j * dy), int(x + j * dx)] = True


@kernel()
def _passable(grid: np.ndarray, row: int, column: int, radius: float, hopeful: bool) -> bool:
    """Whether a disc about a free cell holds the middle of no blocked one.

    Who is hopeful takes unknown cells for free.
    """
    if grid[row, column] == BLOCKED or (grid[row, column] == UNKNOWN and not hopeful):
        return False
    around = int(radius)
    for i in range(-around, around + 1):
        for j in range(-around, around + 1):
            if i * i + j * j <= radius * radius and grid[row + i, column + j] == BLOCKED:
                return False
    return True


@kernel(arrays=True)
def _weigh(grid: np.ndarray, radii: tuple[float, float], hopeful: bool) -> np.ndarray:
    """What entering each cell costs: 0 where it is not `_passable`, 1 far from blocked cells.

    It is 2 on passable cells nearer to a blocked one than the second of the radii. Found from the
    blocked cells, of which there are few.
    """
    rows, columns = grid.shape
    cost = np.empty((rows, columns), np.int8)
    for row in range(rows):
        for column in range(columns):
            state = grid[row, column]
            cost[row, column] = state != BLOCKED and (hopeful or state != UNKNOWN)
    radius, wide = radii
    around = int(wide)
    for row in range(rows):
        for column in range(columns):
            if grid[row, column] != BLOCKED:
                continue
            for r in range(max(0, row - around), min(rows, row + around + 1)):
                for c in range(max(0, column - around), min(columns, column + around + 1)):
                    apart = (r - row) ** 2 + (c - column) ** 2
                    if apart <= radius * radius:
                        cost[r, c] = 0
                    elif apart <= wide * wide and cost[r, c] == 1:
                        cost[r, c] = 2
    return cost


@kernel(arrays=True)
def flood(
    grid: np.ndarray,
    start: tuple[int, int],
    radii: tuple[float, float],
    before: np.ndarray,
    hopeful: bool,
    goal: tuple[int, int],
) -> tuple[np.ndarray, tuple[int, int]]:
    """Flood the passable cells from `start`, nearest first: the way to each, -1 beyond.

    A step to a cell beside is `STEP` long, one across a corner `ACROSS`; to a cell that is nearer
    to a blocked one than the second of the radii twice that. Cells nearer than the first are not
    passable, but near the start, so that a robot close to a wall can leave it: there only
    blocked cells are not. `before` receives the flat index of the cell before each.

    With a `goal` that is a cell of the grid, those come first from which the way there could be
    shortest (P. Hart, N. Nilsson and B. Raphael, A formal basis for the heuristic determination
    of minimum cost paths, 1968). The flood ends there, or at the first wanted cell, if it gets to
    one: the ways to cells that do not lie on the way may then be too long, or missing. Which it
    ended at is returned too, (-1, -1) for none.

    Cells wait in lists by the length of the way by them, as far as it is known, modulo the number
    of the lists (R. Dial, Algorithm 360, Communications of the ACM 12, 1969).
    """
    rows, columns = grid.shape
    radius, wide = radii
    border = int(wide)
    cost = _weigh(grid, radii, hopeful)
    ways = np.full((rows, columns), -1, np.int32)
    done = np.zeros((rows, columns), np.bool_)
    waiting = np.empty(8 * rows * columns + 1, np.int32)
    following = np.empty(8 * rows * columns + 1, np.int32)
    lists = np.full(_LISTS, -1)
    waiting[0], following[0] = start[0] * columns + start[1], -1
    ways[start[0], start[1]] = 0
    before[start[0], start[1]] = waiting[0]
    count, empty, length = 1, 0, _left(start[0], start[1], goal)
    lists[length % _LISTS] = 0
    while empty < _LISTS:
        k = lists[length % _LISTS]
        if k < 0:
            length, empty = length + 1, empty + 1
            continue
        empty, lists[length % _LISTS] = 0, following[k]
        here = waiting[k]
        row, column = here // columns, here % columns
        if done[row, column]:
            continue  # A shorter way was found since.
        done[row, column] = True
        is_end = row == goal[0] and column == goal[1]
        if is_end or (grid[row, column] == WANTED and cost[row, column] > 0):
            return ways, (row, column)
        for i in range(9):
            r, c = row + (i // 3) - 1, column + (i % 3) - 1
            inside = border <= r < rows - border and border <= c < columns - border
            if not inside:
                continue
            near = (r - start[0]) ** 2 + (c - start[1]) ** 2 <= (radius + 1) ** 2
            step = STEP if r == row or c == column else ACROSS
            reached = ways[row, column] + step * max(1, cost[r, c])
            if 0 <= ways[r, c] <= reached:
                continue
            if cost[r, c] > 0 or (near and grid[r, c] != BLOCKED):
                ways[r, c], before[r, c] = reached, here
                waits = (reached + _left(r, c, goal)) % _LISTS
                waiting[count] = r * columns + c
                following[count], lists[waits] = lists[waits], count
                count += 1
    return ways, (-1, -1)


@kernel()
def _left(row: int, column: int, goal: tuple[int, int]) -> int:
    """How long the way from a cell to the goal is at least; 0 where there is no goal."""
    if goal[0] < 0:
        return 0
    down, across = abs(row - goal[0]), abs(column - goal[1])
    return STEP * max(down, across) + (ACROSS - STEP) * min(down, across)


@kernel()
def nearest_reached(ways: np.ndarray, row: int, column: int, around: int) -> tuple[int, int]:
    """The cell of a square about one to which the way is shortest; (-1, -1) for none."""
    best, least = (-1, -1), np.iinfo(np.int32).max
    for r in range(max(0, row - around), min(ways.shape[0], row + around + 1)):
        for c in range(max(0, column - around), min(ways.shape[1], column + around + 1)):
            if 0 <= ways[r, c] < least:
                best, least = (r, c), ways[r, c]
    return best


@kernel(arrays=True)
def trace(ways: np.ndarray, before: np.ndarray, end: tuple[int, int]) -> np.ndarray:
    """The cells (n, 2) of the way on which a flood came to the cell `end`, that one last."""
    columns = ways.shape[1]
    index, count = end[0] * columns + end[1], 1
    while ways[index // columns, index % columns] > 0:
        index = before[index // columns, index % columns]
        count += 1
    cells = np.empty((count, 2), np.int64)
    index = end[0] * columns + end[1]
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = index // columns, index % columns
        index = before[index // columns, index % columns]
    return cells


@kernel()
def straight_is_free(
    grid: np.ndarray, start: tuple[int, int], end: tuple[int, int], radius: float, hopeful: bool
) -> bool:
    """Whether a disc can go straight from cell to cell; near the start as in `flood`."""
    rows, columns = end[0] - start[0], end[1] - start[1]
    count = max(abs(rows), abs(columns))
    for k in range(1, count + 1):
        row = start[0] + int(np.round(rows * k / count))
        column = start[1] + int(np.round(columns * k / count))
        near = (row - start[0]) ** 2 + (column - start[1]) ** 2 <= (radius + 1) ** 2
        if near:
            if grid[row, column] == BLOCKED:
                return False
        elif not _passable(grid, row, column, radius, hopeful):
            return False
    return True


@kernel(arrays=True)
def farthest_straight(
    grid: np.ndarray,
    place: tuple[float, float],
    cells: np.ndarray,
    sights: tuple[float, float],
    radii: tuple[float, float],
    hopeful: bool,
) -> int:
    """Number of the last of `cells`, a way, to which a disc can go straight from a place.

    It is as wide as the second of the radii, or as the first where it would not come as far as
    the first of the sights so; it comes no farther than the second. All in cells. The way is
    followed from where it passes nearest to the place; where nothing on it is straight, it
    is the second cell from there.
    """
    start = int(place[0]), int(place[1])
    count = cells.shape[0]
    away = np.empty(count)
    for k in range(count):
        away[k] = length_of(cells[k, 0] + 0.5 - place[0], cells[k, 1] + 0.5 - place[1])
    here = int(np.argmin(away))
    for radius, least in ((radii[1], sights[0]), (radii[0], 0.0)):
        for k in range(count - 1, here - 1, -1):
            end = cells[k, 0], cells[k, 1]
            seen = least <= away[k] < sights[1]
            if seen and straight_is_free(grid, start, end, radius, hopeful):
                return k
    return int(min(here + 2, count - 1))


@kernel(arrays=True)
def blocked_around(grid: np.ndarray, row: int, column: int, around: int) -> np.ndarray:
    """Rows and columns (n, 2) of the blocked cells of a square about a cell."""
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
    """The share (n,) of a square about each cell that is neither covered nor blocked.

    It is 0 about cells that are either themselves. What lies beyond the sheet's edges is neither.
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
