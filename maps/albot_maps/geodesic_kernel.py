"""The compiled halves of `geodesic`. Lengths are in cells of the lattice."""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel
from albot_maps.flood_kernel import BLOCKED

FAR = -1
"""The anchor of a point from which no way leads."""
SEARCHED = 3
"""How many cells around a place an open point is looked for."""


@kernel()
def sees(
    state: np.ndarray, columns: int, rows: int, x: float, y: float, to_x: float, to_y: float
) -> bool:
    """Whether the straight line between two places is clear, but for a cell at its first end."""
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
    """Put an item on a binary heap that holds `size`."""
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
    """Take the first item off a binary heap that holds `size`."""
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


@kernel(arrays=True)
def spread(
    state: np.ndarray,
    columns: int,
    rows: int,
    goal_x: float,
    goal_y: float,
    anchors: np.ndarray,
    anchor_of: np.ndarray,
) -> int:
    """Find the shortest ways to the goal from all open points; return how many anchors they have.

    Basic Theta* (Nash et al., Theta*: Any-angle path planning on grids, AAAI 2007) from the
    goal over the whole lattice.

    Args:
        state: `BLOCKED` where a point is closed (points,).
        columns: How many columns of points there are.
        rows: How many points in each.
        goal_x: Where the goal is.
        goal_y: Where the goal is.
        anchors: Filled in (points + 1, 4): x, y of the places at which ways turn, how far it
            is from there to the goal, and the next anchor that way. The first is the goal.
        anchor_of: Filled in (points,): the first anchor on the way from a point.
    """
    points = columns * rows
    lengths = np.full(points, np.inf)
    number = np.full(points, FAR, np.int32)  # the point as an anchor
    settled = np.zeros(points, np.bool_)
    heap, keys = np.empty(8 * points + 64, np.int64), np.empty(8 * points + 64)
    anchor_of[:] = FAR
    anchors[0] = 0.0
    anchors[0, 0], anchors[0, 1] = goal_x, goal_y
    size = _begin(state, columns, rows, anchors, anchor_of, lengths, heap, keys)
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
            if not sees(state, columns, rows, anchors[a, 0], anchors[a, 1], c, r):
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
def _begin(
    state: np.ndarray,
    columns: int,
    rows: int,
    anchors: np.ndarray,
    anchor_of: np.ndarray,
    lengths: np.ndarray,
    heap: np.ndarray,
    keys: np.ndarray,
) -> int:
    """Put the points around the goal, from which it is in sight, on the heap; how many."""
    x, y, size = anchors[0, 0], anchors[0, 1], 0
    left, bottom = math.floor(x), math.floor(y)
    for column in range(max(0, left - SEARCHED), min(columns, left + SEARCHED + 2)):
        for row in range(max(0, bottom - SEARCHED), min(rows, bottom + SEARCHED + 2)):
            i = column * rows + row
            if state[i] != BLOCKED and sees(state, columns, rows, x, y, column, row):
                anchor_of[i], lengths[i] = 0, length_of(column - x, row - y)
                _push(heap, keys, size, i, lengths[i])
                size += 1
    return size


@kernel()
def first_anchor(
    x: float, y: float, columns: int, rows: int, anchors: np.ndarray, anchor_of: np.ndarray
) -> int:
    """The anchor by which the way from a place is shortest; FAR where no way is near.

    Of the anchors of the four points around it, or else of those up to `SEARCHED` cells away.
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
            break
    return best
