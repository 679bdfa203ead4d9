"""Compiled searches over grids: shortest paths and connectivity.

- `search_grid`: Dijkstra's search, or A* with a goal, over an occupancy grid whose cells near
  obstacles cost more. It is for planning while the robot drives. `begin_search`, `next_cell` and
  `expand` are its parts, for a search that is to end elsewhere.
- `flood_fill`: the points connected to a start. It is for proofs that a world can be explored.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

UNKNOWN, FREE, BLOCKED, TARGET, REACHED = 0, 1, 2, 3, 4
"""States of cells. A search may end at any `TARGET` cell, which is also free. `REACHED` cells were
reached by `flood_fill`."""
STEP, DIAGONAL = 5, 7
"""Lengths of a step to an adjacent and to a diagonal cell; 7 / 5 approximates √2."""
_BUCKETS = 32
"""Number of buckets: more than a step can add to a path's length plus heuristic."""


@kernel(arrays=True)
def search_grid(
    grid: np.ndarray,
    start: tuple[int, int],
    radii: tuple[float, float],
    parents: np.ndarray,
    unknown_is_free: bool,
    goal: tuple[int, int],
) -> tuple[np.ndarray, tuple[int, int]]:
    """Find the shortest paths from `start` to all passable cells.

    A step to an adjacent cell has length `STEP`, a diagonal step `DIAGONAL`. Cells within the first
    radius of a blocked cell are not passable. A step to a cell within the second radius counts
    twice. Near the start only blocked cells are not passable, so that a robot close to a wall can
    leave it.

    Without a goal this is Dijkstra's search. With a `goal`, a cell of the grid, it is A* (P. Hart,
    N. Nilsson and B. Raphael, A formal basis for the heuristic determination of minimum cost
    paths, 1968). It ends at the goal. Paths to cells off the path to the goal may then be too long
    or missing. With or without a goal, the search ends at the first `TARGET` cell.

    The open list consists of buckets: cells are sorted by the estimated length of the path through
    them, modulo the number of buckets (R. Dial, Algorithm 360, Communications of the ACM 12, 1969).

    Args:
        grid: States of the cells (rows, columns).
        start: Row and column of the start.
        radii: The two radii (cells).
        parents: Output (rows, columns): flat index of the previous cell on each cell's path.
        unknown_is_free: Whether unknown cells count as free.
        goal: Row and column of the goal; (-1, -1) for none.

    Returns:
        The path lengths (rows, columns), -1 without a path; and the cell at which the search
        ended, (-1, -1) if it searched all cells.
    """
    search = begin_search(grid, start, radii, parents, unknown_is_free, goal)
    while True:
        cell = next_cell(search)
        if cell[0] < 0 or (cell[0] == goal[0] and cell[1] == goal[1]):
            return search.lengths, cell
        if grid[cell] == TARGET and search.costs[cell[0] + 1, cell[1] + 1] > 0:
            return search.lengths, cell
        expand(search, cell, goal)


class GridSearch(NamedTuple):
    """A search under way, for those who end it themselves: `search_grid` runs one to its end."""

    lengths: np.ndarray
    """(rows, columns) int32: length of the shortest path found to each cell so far; -1 for none."""
    parents: np.ndarray
    """(rows, columns) int64: flat index of the previous cell on each cell's path."""
    costs: np.ndarray
    """(rows + 2, columns + 2) int8: cost factor of a step to each cell; see `_enter_costs`."""
    done: np.ndarray
    """(rows, columns) bool: whether the shortest path to each cell is known."""
    waiting: np.ndarray
    """int32: flat indices of the cells in the open list."""
    following: np.ndarray
    """int32: number of the next one in the same bucket; -1 for none."""
    buckets: np.ndarray
    """int64: number of the first one in each bucket; -1 for none."""
    counts: np.ndarray
    """(2,) int64: length of the open list, with those that left it; estimated length of the path
    through the cell that left it last."""


@kernel(arrays=True)
def begin_search(
    grid: np.ndarray,
    start: tuple[int, int],
    radii: tuple[float, float],
    parents: np.ndarray,
    unknown_is_free: bool,
    goal: tuple[int, int],
) -> GridSearch:
    """Begin a search with the arguments of `search_grid`."""
    rows, columns = grid.shape
    search = GridSearch(
        lengths=np.full((rows, columns), -1, np.int32),
        parents=parents,
        costs=_enter_costs(grid, start, radii, unknown_is_free),
        done=np.zeros((rows, columns), np.bool_),
        waiting=np.empty(8 * rows * columns + 1, np.int32),
        following=np.empty(8 * rows * columns + 1, np.int32),
        buckets=np.full(_BUCKETS, -1),
        counts=np.empty(2, np.int64),
    )
    search.waiting[0], search.following[0] = start[0] * columns + start[1], -1
    search.lengths[start[0], start[1]] = 0
    parents[start[0], start[1]] = search.waiting[0]
    search.counts[0], search.counts[1] = 1, _heuristic(start[0], start[1], goal)
    search.buckets[search.counts[1] % _BUCKETS] = 0
    return search


@kernel()
def next_cell(search: GridSearch) -> tuple[int, int]:
    """Take the next cell from the open list, whose shortest path is known; (-1, -1) for none."""
    columns, empty, length = search.lengths.shape[1], 0, search.counts[1]
    while empty < _BUCKETS:
        k = search.buckets[length % _BUCKETS]
        if k < 0:
            length, empty = length + 1, empty + 1
            continue
        empty, search.buckets[length % _BUCKETS] = 0, search.following[k]
        row, column = search.waiting[k] // columns, search.waiting[k] % columns
        if search.done[row, column]:
            continue  # A shorter path was found since.
        search.done[row, column] = True
        search.counts[1] = length
        return row, column
    return -1, -1


@kernel()
def expand(search: GridSearch, cell: tuple[int, int], goal: tuple[int, int]) -> None:
    """Enter the neighbours of a cell from `next_cell` in the open list."""
    row, column = cell
    columns, so_far, count = search.lengths.shape[1], search.lengths[cell], search.counts[0]
    for r in range(row - 1, row + 2):
        for c in range(column - 1, column + 2):
            cost = search.costs[r + 1, c + 1]
            if cost == 0:
                continue
            step = STEP if r == row or c == column else DIAGONAL
            reached = so_far + step * abs(cost)
            if 0 <= search.lengths[r, c] <= reached:
                continue
            search.lengths[r, c], search.parents[r, c] = reached, row * columns + column
            waits = (reached + _heuristic(r, c, goal)) % _BUCKETS
            search.waiting[count] = r * columns + c
            search.following[count], search.buckets[waits] = search.buckets[waits], count
            count += 1
    search.counts[0] = count


@kernel(arrays=True)
def _enter_costs(
    grid: np.ndarray, start: tuple[int, int], radii: tuple[float, float], unknown_is_free: bool
) -> np.ndarray:
    """Return the cost factor of a step to each cell, with a ring of 0 around the grid.

    It is 0 if the cell is not passable, 2 within the second radius of a blocked cell, 1 elsewhere,
    and -1 if the cell is passable only because it is near the start. A border as wide as the second
    radius is not passable, because obstacles beyond the grid are not known. The loop runs over the
    blocked cells because there are few.
    """
    rows, columns = grid.shape
    radius, wide = radii
    border = around = int(wide)
    costs = np.zeros((rows + 2, columns + 2), np.int8)
    blocked = np.empty(rows * columns, np.int32)
    count = 0
    for row in range(rows):
        for column in range(columns):
            state = grid[row, column]
            costs[row + 1, column + 1] = state != BLOCKED and (unknown_is_free or state != UNKNOWN)
            if state == BLOCKED:
                blocked[count] = row * columns + column
                count += 1
    for k in range(count):
        row, column = blocked[k] // columns, blocked[k] % columns
        for r in range(max(0, row - around), min(rows, row + around + 1)):
            for c in range(max(0, column - around), min(columns, column + around + 1)):
                apart = (r - row) ** 2 + (c - column) ** 2
                if apart <= radius * radius:
                    costs[r + 1, c + 1] = 0
                elif apart <= wide * wide and costs[r + 1, c + 1] == 1:
                    costs[r + 1, c + 1] = 2
    costs[: border + 1] = 0
    costs[rows + 1 - border :] = 0
    costs[:, : border + 1] = 0
    costs[:, columns + 1 - border :] = 0
    _open_near_start(costs, grid, start, radii)
    return costs


@kernel()
def _open_near_start(
    costs: np.ndarray, grid: np.ndarray, start: tuple[int, int], radii: tuple[float, float]
) -> None:
    """Write -1 to the costs of cells near the start that are not blocked, but not passable."""
    rows, columns = grid.shape
    border, reach = int(radii[1]), int(radii[0]) + 1
    for r in range(max(border, start[0] - reach), min(rows - border, start[0] + reach + 1)):
        for c in range(max(border, start[1] - reach), min(columns - border, start[1] + reach + 1)):
            near = (r - start[0]) ** 2 + (c - start[1]) ** 2 <= (radii[0] + 1) ** 2
            if near and costs[r + 1, c + 1] == 0 and grid[r, c] != BLOCKED:
                costs[r + 1, c + 1] = -1


@kernel()
def _heuristic(row: int, column: int, goal: tuple[int, int]) -> int:
    """Return the least length of a path from a cell to the goal; 0 without a goal."""
    if goal[0] < 0:
        return 0
    down, across = abs(row - goal[0]), abs(column - goal[1])
    return STEP * max(down, across) + (DIAGONAL - STEP) * min(down, across)


@kernel()
def nearest_reached(lengths: np.ndarray, row: int, column: int, around: int) -> tuple[int, int]:
    """Return the cell with the shortest path in a square around a cell; (-1, -1) for none."""
    best, least = (-1, -1), np.iinfo(np.int32).max
    for r in range(max(0, row - around), min(lengths.shape[0], row + around + 1)):
        for c in range(max(0, column - around), min(lengths.shape[1], column + around + 1)):
            if 0 <= lengths[r, c] < least:
                best, least = (r, c), lengths[r, c]
    return best


@kernel(arrays=True)
def trace_path(lengths: np.ndarray, parents: np.ndarray, end: tuple[int, int]) -> np.ndarray:
    """Return the cells (n, 2) of the path from `search_grid` to the cell `end`, including it."""
    columns = lengths.shape[1]
    index, count = end[0] * columns + end[1], 1
    while lengths[index // columns, index % columns] > 0:
        index = parents[index // columns, index % columns]
        count += 1
    cells = np.empty((count, 2), np.int64)
    index = end[0] * columns + end[1]
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = index // columns, index % columns
        index = parents[index // columns, index % columns]
    return cells


@kernel()
def flood_fill(state: np.ndarray, rows: int, waiting: np.ndarray) -> None:
    """Mark as `REACHED` all open points that are 4-connected to the first point.

    Args:
        state: 0 for open points (points,); changed in place.
        rows: Number of points per column.
        waiting: Scratch buffer of at least 4 points + 1 items; the first item is the index of the
            first point.
    """
    count = 1
    while count:
        count -= 1
        here = waiting[count]
        if state[here] != 0:
            continue
        state[here] = REACHED
        row = here % rows
        if row > 0:
            waiting[count] = here - 1
            count += 1
        if row + 1 < rows:
            waiting[count] = here + 1
            count += 1
        if here >= rows:
            waiting[count] = here - rows
            count += 1
        if here + rows < len(state):
            waiting[count] = here + rows
            count += 1
