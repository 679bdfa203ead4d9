"""The Voronoi skeleton of free ground, and its branches. Compiled.

The skeleton is what is left of the free cells when they are removed from the walls inwards, as long
as that changes no connection (C. Pudney, Distance-ordered homotopic thinning, CVIU 1998). It is
pruned on the way: an arm keeps its tip only where the clearance hardly grows along the arm, so an
arm into a corner of a room goes, and a corridor's stays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Int32, Int64

from albot_core.kernels.compiled import kernel

_SLOPE = 0.4
"""Growth of the clearance per distance above which an arm loses its tip. Along the arm into a
corner of 90° it is 0.71, along a corridor 0."""
_NEAR = 4
"""Distance at which this growth is measured (cells)."""
_BINS = 8
"""Steps of the clearance per cell in which cells are removed."""


class Skeleton(NamedTuple):
    """A skeleton as branches from node to node."""

    cells: Int32[np.ndarray, "cells 2"]
    """Row and column of the cells of all branches, one after another, their nodes included."""
    ends: Int64[np.ndarray, "branches"]
    """The end of each branch among the cells."""
    nodes: Int32[np.ndarray, "branches 2"]
    """Degree of the nodes at which each branch begins and ends: 1 for a tip; 0 for a branch that
    is a ring or a single cell."""


def _is_simple(bits: int) -> bool:
    """Return whether removing a cell keeps the connections, given which neighbours are set.

    The neighbours are counted counter-clockwise from the east; the set is 8-connected.
    """
    ring = [bits >> k & 1 for k in range(8)]
    # Yokoi's number of 8-connected components around the cell.
    count = sum(
        (1 - ring[k]) - (1 - ring[k]) * (1 - ring[(k + 1) % 8]) * (1 - ring[(k + 2) % 8])
        for k in range(0, 8, 2)
    )
    return count == 1


def _is_tip(bits: int) -> bool:
    """Return whether a cell is the tip of an arm: it has one neighbour, or two that touch."""
    turned = [(bits >> k | bits << 8 - k) & 255 for k in range(8)]
    return 0b1 in turned or 0b11 in turned


_SIMPLE = np.array([_is_simple(bits) for bits in range(256)])
_TIP = np.array([_is_tip(bits) for bits in range(256)])
_ROWS = np.array((0, 1, 1, 1, 0, -1, -1, -1))
_COLUMNS = np.array((1, 1, 0, -1, -1, -1, 0, 1))
"""The neighbours of a cell, counter-clockwise from the east."""


def skeleton_of(clearance: Float32[np.ndarray, "rows columns"]) -> Skeleton:
    """Return the skeleton of the cells with a positive clearance.

    Args:
        clearance: Distance of each cell to the nearest wall (cells), 0 for walls. The outermost
            rows and columns must be walls.
    """
    kept = thinned(clearance)
    cells, ends, nodes, count, branches = trace_branches(kept)
    return Skeleton(cells[:count], ends[:branches], nodes[:branches])


@kernel(arrays=True)
def sealed(free: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "rows columns"]:
    """Return the free cells without those that touch another one between two corners of a wall.

    A thin wall that runs aslant is a chain of cells that touch by their corners. The skeleton is
    8-connected, and would lead through it.
    """
    kept = free.copy()
    rows, columns = kept.shape
    changed = True
    while changed:
        changed = False
        for i in range(rows - 1):
            for j in range(columns - 1):
                one = kept[i, j] and kept[i + 1, j + 1]
                other = kept[i, j + 1] and kept[i + 1, j]
                if one and not kept[i, j + 1] and not kept[i + 1, j]:
                    kept[i, j], changed = False, True
                elif other and not kept[i, j] and not kept[i + 1, j + 1]:
                    kept[i, j + 1], changed = False, True
    return kept


@kernel(arrays=True)
def distances(free: Bool[np.ndarray, "rows columns"]) -> Float32[np.ndarray, "rows columns"]:
    """Return the distance of each free cell to the nearest cell that is not free (cells).

    P. Felzenszwalb and D. Huttenlocher, Distance transforms of sampled functions, Theory of
    Computing 2012. Without any such cell the distances are those to beyond the grid.
    """
    rows, columns = free.shape
    away = _within_columns(free)
    found = np.zeros(free.shape, np.float32)
    at, bounds = np.empty(columns, np.int64), np.empty(columns + 1)
    for i in range(rows):
        stop = 0
        while stop < columns:
            # A run of free cells and the cells at its ends: nothing beyond those is nearer.
            start = stop
            while start < columns and not free[i, start]:
                start += 1
            stop = start
            while stop < columns and free[i, stop]:
                stop += 1
            if start < stop:
                first, last = max(start - 1, 0), min(stop + 1, columns)
                _nearest_in_row(away[i], first, last, at, bounds, found[i])
    return found


@kernel(arrays=True)
def _within_columns(free: np.ndarray) -> np.ndarray:
    """Return the distance of each cell to the nearest one in its column that is not free (cells).

    It goes row by row, as the cells lie in memory.
    """
    rows, columns = free.shape
    far = rows + columns
    away = np.empty(free.shape, np.int32)
    for j in range(columns):
        away[0, j] = far if free[0, j] else 0
    for i in range(1, rows):
        for j in range(columns):
            away[i, j] = min(away[i - 1, j] + 1, far) if free[i, j] else 0
    for i in range(rows - 2, -1, -1):
        for j in range(columns):
            away[i, j] = min(away[i, j], away[i + 1, j] + 1)
    return away


@kernel()
def _nearest_in_row(
    away: np.ndarray, start: int, stop: int, at: np.ndarray, bounds: np.ndarray, found: np.ndarray
) -> None:
    """Find the distances of some cells of a row by the lower envelope of their parabolas.

    Args:
        away: Distance of each cell of the row to the nearest one in its column (cells).
        start: The first of the cells.
        stop: The end of the cells.
        at: Scratch buffer: the parabolas of the envelope (columns,).
        bounds: Scratch buffer: where each of them begins (columns + 1,).
        found: Output: the distances (columns,).
    """
    count = 0
    at[0], bounds[0], bounds[1] = start, -np.inf, np.inf
    for j in range(start + 1, stop):
        height = away[j] * away[j] + j * j
        while True:
            k = at[count]
            cut = (height - away[k] * away[k] - k * k) / (2.0 * (j - k))
            if cut > bounds[count]:
                break
            count -= 1
        count += 1
        at[count], bounds[count], bounds[count + 1] = j, cut, np.inf
    count = 0
    for j in range(start, stop):
        while bounds[count + 1] < j:
            count += 1
        k = at[count]
        found[j] = math.sqrt((j - k) * (j - k) + away[k] * away[k])


@kernel(arrays=True)
def thinned(clearance: np.ndarray) -> np.ndarray:
    """Return the cells of the skeleton (rows, columns)."""
    columns = clearance.shape[1]
    kept = clearance > 0.0
    kept[0, :] = kept[-1, :] = False
    kept[:, 0] = kept[:, -1] = False
    order = _by_clearance(clearance, kept)
    flat = kept.reshape(-1)
    # The neighbours from the east counter-clockwise, as `_ROWS` and `_COLUMNS` count them.
    up = np.uint64(columns)
    one, more = np.uint64(1), np.uint64(columns + 1)
    less = np.uint64(columns - 1)
    # A cell that had to stay may be removed after the cells behind it, so passes are repeated.
    size, left = -1, len(order)
    while left != size:
        size, left = left, 0
        for n in range(size):
            cell = order[n]
            k = np.uint64(cell)  # numba looks for negative indices else.
            bits = (
                flat[k + one]
                | flat[k + more] << 1
                | flat[k + up] << 2
                | flat[k + less] << 3
                | flat[k - one] << 4
                | flat[k - more] << 5
                | flat[k - up] << 6
                | flat[k - less] << 7
            )
            is_removed = _SIMPLE[bits]
            if is_removed and _TIP[bits]:
                is_removed = _is_steep(clearance, cell // columns, cell % columns)
            if is_removed:
                flat[k] = False
            else:
                order[left] = cell
                left += 1
    return kept


@kernel(arrays=True)
def _by_clearance(clearance: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Return the numbers of the kept cells, the ones nearest to walls first."""
    rows, columns = clearance.shape
    starts = np.zeros(int(clearance.max() * _BINS) + 2, np.int64)
    for row in range(rows):
        for column in range(columns):
            if kept[row, column]:
                starts[int(clearance[row, column] * _BINS) + 1] += 1
    for k in range(1, len(starts)):
        starts[k] += starts[k - 1]
    order = np.empty(starts[-1], np.int64)
    for row in range(rows):
        for column in range(columns):
            if kept[row, column]:
                k = int(clearance[row, column] * _BINS)
                order[starts[k]] = row * columns + column
                starts[k] += 1
    return order


@kernel()
def _is_steep(clearance: np.ndarray, row: int, column: int) -> bool:
    """Return whether the clearance grows fast in some direction."""
    rows, columns = clearance.shape
    for i in range(max(row - _NEAR, 0), min(row + _NEAR + 1, rows)):
        for j in range(max(column - _NEAR, 0), min(column + _NEAR + 1, columns)):
            away = math.sqrt((i - row) ** 2 + (j - column) ** 2)
            if away < _NEAR - 0.5 or away > _NEAR + 0.5:
                continue
            if clearance[i, j] - clearance[row, column] > _SLOPE * away:
                return True
    return False


@kernel(arrays=True)
def trace_branches(
    kept: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """Return the fields of `Skeleton` with spare rows, and the numbers of cells and branches.

    Nodes are cells with one neighbour or with more than two. Neighbouring nodes make no branch.
    """
    listed = np.argwhere(kept[1:-1, 1:-1]) + 1
    total = len(listed)
    cells = np.empty((4 * total + 8, 2), np.int32)
    ends, nodes = np.empty(2 * total + 2, np.int64), np.zeros((2 * total + 2, 2), np.int32)
    degree = np.zeros(kept.shape, np.int32)
    for n in range(total):
        row, column = listed[n]
        degree[row, column] = _degree(kept, row, column)
    used = np.zeros(kept.shape, np.bool_)
    count = branches = 0
    for kind in range(3):  # From nodes; round the rings that are left; and cells alone.
        for n in range(total):
            row, column = listed[n]
            if _kind(degree[row, column]) != kind:
                continue
            if kind == 2:
                cells[count, 0], cells[count, 1] = row, column
                count += 1
                ends[branches] = count
                branches += 1
                continue
            count, branches = _leave(
                kept, degree, used, cells, ends, nodes, count, branches, row, column
            )
    return cells, ends, nodes, count, branches


@kernel()
def _leave(
    kept: np.ndarray,
    degree: np.ndarray,
    used: np.ndarray,
    cells: np.ndarray,
    ends: np.ndarray,
    nodes: np.ndarray,
    count: int,
    branches: int,
    row: int,
    column: int,
) -> tuple[int, int]:
    """Follow the branches that leave a node, or a ring from one of its cells.

    Returns:
        The numbers of cells and branches.
    """
    is_ring = degree[row, column] == 2
    if is_ring and used[row, column]:
        return count, branches
    used[row, column] = is_ring
    for n in range(8):
        i, j = row + _ROWS[n], column + _COLUMNS[n]
        if not kept[i, j] or used[i, j] or degree[i, j] != 2:
            continue
        cells[count, 0], cells[count, 1] = row, column
        nodes[branches, 0] = 0 if is_ring else degree[row, column]
        count, nodes[branches, 1] = _follow(kept, degree, used, cells, count + 1, i, j)
        ends[branches] = count
        branches += 1
        if is_ring:
            break
    return count, branches


@kernel()
def _kind(degree: int) -> int:
    """Return 0 for a node, 1 for a cell of a branch, and 2 for a cell without a neighbour."""
    if degree == 0:
        return 2
    return 1 if degree == 2 else 0


@kernel()
def _follow(
    kept: np.ndarray,
    degree: np.ndarray,
    used: np.ndarray,
    cells: np.ndarray,
    count: int,
    i: int,
    j: int,
) -> tuple[int, int]:
    """Follow a branch from its second cell; return the number of cells and the last one's degree.

    The degree is 0 where the branch comes round to its beginning.
    """
    while True:
        cells[count, 0], cells[count, 1] = i, j
        count += 1
        if degree[i, j] != 2:
            return count, degree[i, j]
        used[i, j] = True
        before_i, before_j = cells[count - 2, 0], cells[count - 2, 1]
        next_i = next_j = -1
        for n in (0, 2, 4, 6, 1, 3, 5, 7):
            a, b = i + _ROWS[n], j + _COLUMNS[n]
            # Two steps of a branch may touch; the one before is not the next.
            is_back = a == before_i and b == before_j
            if kept[a, b] and not is_back and not (degree[a, b] == 2 and used[a, b]):
                next_i, next_j = a, b
                break
        if next_i < 0:
            return count, 0
        i, j = next_i, next_j


@kernel()
def _degree(kept: np.ndarray, row: int, column: int) -> int:
    """Return how many branches leave a cell: the groups of neighbours that touch by their sides."""
    groups = 0
    for n in range(8):
        here = kept[row + _ROWS[n], column + _COLUMNS[n]]
        before = kept[row + _ROWS[n - 1], column + _COLUMNS[n - 1]]
        groups += here and not before
    if groups == 0 and kept[row, column + 1]:
        return 1
    return groups
