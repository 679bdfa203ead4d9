"""Compiled searches over grids: shortest paths, any-angle paths, and connectivity.

- `search_grid`: Dijkstra's search, or A* with a goal, over an occupancy grid whose cells near
  obstacles cost more. It is for planning while the robot drives.
- `search_any_angle`: Theta*, over a lattice of open and closed points. Its paths are not limited to
  the grid's directions, so their lengths are nearly exact. It is for true distances.
- `flood_fill`: the points connected to a start. It is for proofs that a world can be explored.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel

UNKNOWN, FREE, BLOCKED, TARGET, REACHED = 0, 1, 2, 3, 4
"""States of cells. A search may end at any `TARGET` cell, which is also free. `REACHED` cells were
reached by `flood_fill`."""
STEP, DIAGONAL = 5, 7
"""Lengths of a step to an adjacent and to a diagonal cell; 7 / 5 approximates √2."""
_BUCKETS = 32
"""Number of buckets: more than a step can add to a path's length plus heuristic."""
FAR = -1
"""The anchor of a point from which no path leads."""
SEARCHED = 3
"""Largest distance (cells) from a position at which open points are searched."""


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
    rows, columns = grid.shape
    radius, wide = radii
    border = int(wide)
    cost = _enter_costs(grid, radii, unknown_is_free)
    lengths = np.full((rows, columns), -1, np.int32)
    done = np.zeros((rows, columns), np.bool_)
    waiting = np.empty(8 * rows * columns + 1, np.int32)
    following = np.empty(8 * rows * columns + 1, np.int32)
    buckets = np.full(_BUCKETS, -1)
    waiting[0], following[0] = start[0] * columns + start[1], -1
    lengths[start[0], start[1]] = 0
    parents[start[0], start[1]] = waiting[0]
    count, empty, length = 1, 0, _heuristic(start[0], start[1], goal)
    buckets[length % _BUCKETS] = 0
    while empty < _BUCKETS:
        k = buckets[length % _BUCKETS]
        if k < 0:
            length, empty = length + 1, empty + 1
            continue
        empty, buckets[length % _BUCKETS] = 0, following[k]
        here = waiting[k]
        row, column = here // columns, here % columns
        if done[row, column]:
            continue  # A shorter path was found since.
        done[row, column] = True
        is_end = row == goal[0] and column == goal[1]
        if is_end or (grid[row, column] == TARGET and cost[row, column] > 0):
            return lengths, (row, column)
        for i in range(9):
            r, c = row + (i // 3) - 1, column + (i % 3) - 1
            inside = border <= r < rows - border and border <= c < columns - border
            if not inside:
                continue
            near = (r - start[0]) ** 2 + (c - start[1]) ** 2 <= (radius + 1) ** 2
            step = STEP if r == row or c == column else DIAGONAL
            reached = lengths[row, column] + step * max(1, cost[r, c])
            if 0 <= lengths[r, c] <= reached:
                continue
            if cost[r, c] > 0 or (near and grid[r, c] != BLOCKED):
                lengths[r, c], parents[r, c] = reached, here
                waits = (reached + _heuristic(r, c, goal)) % _BUCKETS
                waiting[count] = r * columns + c
                following[count], buckets[waits] = buckets[waits], count
                count += 1
    return lengths, (-1, -1)


@kernel(arrays=True)
def _enter_costs(grid: np.ndarray, radii: tuple[float, float], unknown_is_free: bool) -> np.ndarray:
    """Return the cost factor of a step to each cell: 0 if not passable, 1 far from blocked cells.

    It is 2 on passable cells within the second radius of a blocked cell. The loop runs over the
    blocked cells because there are few.
    """
    rows, columns = grid.shape
    cost = np.empty((rows, columns), np.int8)
    for row in range(rows):
        for column in range(columns):
            state = grid[row, column]
            cost[row, column] = state != BLOCKED and (unknown_is_free or state != UNKNOWN)
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


@kernel(arrays=True)
def search_any_angle(
    state: np.ndarray,
    columns: int,
    rows: int,
    goal_x: float,
    goal_y: float,
    anchors: np.ndarray,
    anchor_of: np.ndarray,
) -> int:
    """Find the shortest paths from all open points to the goal; return the number of anchors.

    Basic Theta* (Nash et al., Theta*: Any-angle path planning on grids, AAAI 2007), from the goal
    over the whole lattice. Paths run straight from anchor to anchor; lengths are in cells.

    Args:
        state: `BLOCKED` for closed points (points,).
        columns: Number of columns of points.
        rows: Number of points per column.
        goal_x: x of the goal (cells).
        goal_y: y of the goal (cells).
        anchors: Output (points + 1, 4): x, y of the points at which paths turn, the distance
            from there to the goal, and the next anchor on the path. The first is the goal.
        anchor_of: Output (points,): the first anchor on the path from each point.
    """
    points = columns * rows
    lengths = np.full(points, np.inf)
    number = np.full(points, FAR, np.int32)  # the point as an anchor
    settled = np.zeros(points, np.bool_)
    heap, keys = np.empty(8 * points + 64, np.int64), np.empty(8 * points + 64)
    anchor_of[:] = FAR
    anchors[0] = 0.0
    anchors[0, 0], anchors[0, 1] = goal_x, goal_y
    size = _push_points_around_goal(state, columns, rows, anchors, anchor_of, lengths, heap, keys)
    count = 1
    while size:
        here = heap[0]
        _pop(heap, keys, size)
        size -= 1
        if settled[here]:
            continue
        settled[here] = True
        column, row = here // rows, here % rows
        for k in range(9):
            c, r = column + k // 3 - 1, row + k % 3 - 1
            i = c * rows + r
            if not (0 <= c < columns and 0 <= r < rows) or settled[i] or state[i] == BLOCKED:
                continue
            a = anchor_of[here]
            length = anchors[a, 2] + length_of(c - anchors[a, 0], r - anchors[a, 1])
            if length >= lengths[i]:
                continue
            if not _is_line_clear(state, columns, rows, anchors[a, 0], anchors[a, 1], c, r):
                length = lengths[here] + length_of(c - column, r - row)
                if length >= lengths[i]:
                    continue
                if number[here] == FAR:
                    number[here] = count
                    anchors[count, 0], anchors[count, 1] = column, row
                    anchors[count, 2], anchors[count, 3] = lengths[here], a
                    count += 1
                a = number[here]
            anchor_of[i], lengths[i] = a, length
            _push(heap, keys, size, i, length)
            size += 1
    return count


@kernel()
def _push_points_around_goal(
    state: np.ndarray,
    columns: int,
    rows: int,
    anchors: np.ndarray,
    anchor_of: np.ndarray,
    lengths: np.ndarray,
    heap: np.ndarray,
    keys: np.ndarray,
) -> int:
    """Push the points around the goal that see it onto the heap; return how many."""
    x, y, size = anchors[0, 0], anchors[0, 1], 0
    left, bottom = math.floor(x), math.floor(y)
    for column in range(max(0, left - SEARCHED), min(columns, left + SEARCHED + 2)):
        for row in range(max(0, bottom - SEARCHED), min(rows, bottom + SEARCHED + 2)):
            i = column * rows + row
            if state[i] != BLOCKED and _is_line_clear(state, columns, rows, x, y, column, row):
                anchor_of[i], lengths[i] = 0, length_of(column - x, row - y)
                _push(heap, keys, size, i, lengths[i])
                size += 1
    return size


@kernel()
def _is_line_clear(
    state: np.ndarray, columns: int, rows: int, x: float, y: float, to_x: float, to_y: float
) -> bool:
    """Return whether the straight line between two points is clear beyond its first cell."""
    dx, dy = to_x - x, to_y - y
    length = length_of(dx, dy)
    count = math.ceil(2.0 * length)
    for k in range(1, count):
        share = k / count
        if share * length < 1.0:
            continue
        column, row = round(x + share * dx), round(y + share * dy)
        if column < 0 or column >= columns or row < 0 or row >= rows:
            continue
        if state[int(column) * rows + int(row)] == BLOCKED:
            return False
    return True


@kernel()
def _push(heap: np.ndarray, keys: np.ndarray, size: int, item: int, key: float) -> None:
    """Push an item onto a binary heap of `size` items."""
    k = size
    while k > 0:
        parent = (k - 1) >> 1
        if keys[parent] <= key:
            break
        heap[k], keys[k] = heap[parent], keys[parent]
        k = parent
    heap[k], keys[k] = item, key


@kernel()
def _pop(heap: np.ndarray, keys: np.ndarray, size: int) -> None:
    """Remove the first item of a binary heap of `size` items."""
    last = size - 1
    item, key = heap[last], keys[last]
    k = 0
    while True:
        child = 2 * k + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        heap[k], keys[k] = heap[child], keys[child]
        k = child
    heap[k], keys[k] = item, key


@kernel()
def first_anchor(
    x: float, y: float, columns: int, rows: int, anchors: np.ndarray, anchor_of: np.ndarray
) -> int:
    """Return the first anchor of the shortest path from a position; FAR without a path nearby.

    It is one of the anchors of the four points around the position; if these have none, of the
    points in growing squares, up to `SEARCHED` cells away. Off the grid nothing is in the way: it
    is then one of the anchors of the points on the edges that face the position.
    """
    left, bottom = math.floor(x), math.floor(y)
    best, shortest = FAR, np.inf
    for ring in range(SEARCHED + 1):
        for c in range(max(0, left - ring), min(columns, left + 2 + ring)):
            for r in range(max(0, bottom - ring), min(rows, bottom + 2 + ring)):
                a = anchor_of[c * rows + r]
                if a == FAR:
                    continue
                length = anchors[a, 2] + length_of(x - anchors[a, 0], y - anchors[a, 1])
                if length < shortest:
                    best, shortest = a, length
        if best != FAR:
            return best
    return _anchor_from_outside(x, y, columns, rows, anchors, anchor_of)


@kernel()
def _anchor_from_outside(
    x: float, y: float, columns: int, rows: int, anchors: np.ndarray, anchor_of: np.ndarray
) -> int:
    """Return the first anchor of the shortest path from off the grid; FAR without one."""
    best, shortest = FAR, np.inf
    if y < 0.0 or y > rows - 1:
        r = 0 if y < 0.0 else rows - 1
        for c in range(columns):
            best, shortest = _nearer_anchor(best, shortest, x, y, anchors, anchor_of[c * rows + r])
    if x < 0.0 or x > columns - 1:
        c = 0 if x < 0.0 else columns - 1
        for r in range(rows):
            best, shortest = _nearer_anchor(best, shortest, x, y, anchors, anchor_of[c * rows + r])
    return best


@kernel()
def _nearer_anchor(
    best: int, shortest: float, x: float, y: float, anchors: np.ndarray, a: int
) -> tuple[int, float]:
    """Return the better of two anchors, and the length of the path from x, y over it."""
    if a == FAR:
        return best, shortest
    length = anchors[a, 2] + length_of(x - anchors[a, 0], y - anchors[a, 1])
    return (a, length) if length < shortest else (best, shortest)


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
