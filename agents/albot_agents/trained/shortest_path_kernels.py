"""Compiled shortest paths over squares of cells, and the derivatives of their costs.

A step to one of the eight neighbours costs its length (cells) times the mean of the two cells'
costs. The paths lead from the middle cell to a goal by each cell of a rim around the middle. Their
first part, within the rim, and their second, from the rim to the goal, are searched separately.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

_DIAGONAL = math.sqrt(2.0)
_BUCKETS = 1 << 15
"""Largest number of buckets: more than a diagonal step can cost, in costs of the cheapest cell."""


@kernel(arrays=True)
def rim_cells(side: int, radius: int) -> np.ndarray:
    """Return the flat indices of a square rim, from the cell straight ahead counter-clockwise.

    Args:
        side: Number of cells along each side of the patch; its row 0 is farthest ahead.
        radius: Distance of the rim from the middle cell (`side // 2`), in cells.
    """
    middle = side // 2
    rim = np.empty(8 * radius, np.int64)
    row, column = middle - radius, middle
    down, right = 0, -1
    for k in range(8 * radius):
        rim[k] = row * side + column
        if abs(row + down - middle) > radius or abs(column + right - middle) > radius:
            down, right = -right, down  # A corner: turn left.
        row, column = row + down, column + right
    return rim


class _Queue(NamedTuple):
    """Cells that wait, sorted into buckets by the cost of the path to them, modulo their number.

    As R. Dial, Algorithm 360 (Communications of the ACM 12, 1969). No step costs less than a bucket
    is wide, so the cells of a bucket can be settled in any order.
    """

    heads: np.ndarray
    """Place of the first entry of each bucket, -1 if it is empty."""
    following: np.ndarray
    """Place of the next entry of the same bucket."""
    cells: np.ndarray
    """The entries' cells."""
    lengths: np.ndarray
    """The costs of the paths to them."""


@kernel(arrays=True)
def search_paths(
    costs: np.ndarray, goals: np.ndarray, rim: np.ndarray, radius: int, found: np.ndarray,
    before: np.ndarray,
) -> None:  # fmt: skip
    """Find the cheapest paths by each cell of the rim to the goal, in each of several patches.

    Args:
        costs: Costs of the cells (patches, cells), above 0; the dearest at most e¹⁰ times the
            cheapest of its patch.
        goals: Flat index of each patch's goal.
        rim: The rim's cells.
        radius: Its distance from the middle cell.
        found: Output (patches, rim's cells): the costs of the paths.
        before: Output (patches, 2, cells): for cells that were reached from the goal, and within
            the rim from the middle, the previous cell, -1 at the beginning.
    """
    count, cells = costs.shape
    side = int(math.sqrt(cells) + 0.5)
    middle = (side // 2) * (side + 1)
    to_goal, to_middle = np.empty(cells), np.empty(cells)
    queue = _Queue(
        np.empty(_BUCKETS, np.int32),
        np.empty(8 * cells + 1, np.int32),
        np.empty(8 * cells + 1, np.int32),
        np.empty(8 * cells + 1),
    )
    for i in range(count):
        _spread(costs[i], goals[i], side, radius, side, to_goal, before[i, 0], queue)
        _spread(costs[i], middle, side, radius, radius, to_middle, before[i, 1], queue)
        for k in range(len(rim)):
            found[i, k] = to_middle[rim[k]] + to_goal[rim[k]]


@kernel()
def add_path_derivatives(
    rim: np.ndarray, before: np.ndarray, slopes: np.ndarray, derivatives: np.ndarray
) -> None:
    """Add the derivatives by the cells' costs of a sum of path costs times `slopes`.

    The derivative of the cost of the cheapest path by the cost of a cell is the length of the path
    in that cell: where costs change little, the path stays the same.

    Args:
        rim: The rim's cells.
        before: The previous cells, as `search_paths` left them.
        slopes: Factor of each path's cost (patches, rim's cells).
        derivatives: Output (patches, cells), is added to.
    """
    side = int(math.sqrt(derivatives.shape[1]) + 0.5)
    for i in range(len(derivatives)):
        for k in range(len(rim)):
            for part in range(2):
                cell = rim[k]
                previous = before[i, part, cell]
                while previous >= 0:
                    straight = cell // side == previous // side or cell % side == previous % side
                    half = 0.5 * slopes[i, k] * (1.0 if straight else _DIAGONAL)
                    derivatives[i, cell] += half
                    derivatives[i, previous] += half
                    cell, previous = previous, before[i, part, previous]


@kernel()
def _spread(
    costs: np.ndarray, start: int, side: int, rim: int, radius: int, reached: np.ndarray,
    before: np.ndarray, queue: _Queue,
) -> None:  # fmt: skip
    """Search from a cell until the rim's cells are settled (Dial 1969, see `_Queue`).

    Only cells within `radius` of the middle cell, along both axes, are entered.
    """
    middle = side // 2
    low, high = max(0, middle - radius), min(side - 1, middle + radius)
    width, dearest = math.inf, 0.0
    for cell in range(len(costs)):
        reached[cell], before[cell] = math.inf, -1
        width, dearest = min(width, costs[cell]), max(dearest, costs[cell])
    buckets = min(int(_DIAGONAL * dearest / width) + 2, _BUCKETS)
    for k in range(buckets):
        queue.heads[k] = -1
    reached[start] = 0.0
    queue.heads[0], queue.cells[0], queue.following[0], queue.lengths[0] = 0, start, -1, 0.0
    count, bucket, empty, left = 1, 0, 0, 8 * rim
    while empty < buckets and left > 0:
        k = queue.heads[bucket]
        if k < 0:
            bucket, empty = (bucket + 1) % buckets, empty + 1
            continue
        empty, queue.heads[bucket] = 0, queue.following[k]
        cell, so_far = queue.cells[k], queue.lengths[k]
        if so_far > reached[cell]:
            continue  # A cheaper path was found since.
        row, column = cell // side, cell % side
        if max(abs(row - middle), abs(column - middle)) == rim:
            left -= 1
        for r in range(max(low, row - 1), min(high, row + 1) + 1):
            for c in range(max(low, column - 1), min(high, column + 1) + 1):
                other = r * side + c
                length = 0.5 if r == row or c == column else 0.5 * _DIAGONAL
                whole = so_far + length * (costs[cell] + costs[other])
                if whole < reached[other]:
                    reached[other], before[other] = whole, cell
                    waits = int(whole / width) % buckets
                    queue.cells[count], queue.lengths[count] = other, whole
                    queue.following[count], queue.heads[waits] = queue.heads[waits], count
                    count += 1
