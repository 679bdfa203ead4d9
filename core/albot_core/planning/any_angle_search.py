"""Theta*: shortest any-angle paths over a lattice of open and closed points. Compiled.

Its paths are not limited to the grid's directions, so their lengths are nearly exact. It is for
true distances.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import BLOCKED

FAR = -1
"""The anchor of a point from which no path leads."""
SEARCHED = 3
"""Largest distance (cells) from a position at which open points are searched."""


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
