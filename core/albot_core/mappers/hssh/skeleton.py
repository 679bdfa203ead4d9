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
from jaxtyping import Float32, Int32, Int64

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


def _removal(bits: int) -> int:
    """Return whether a cell is removed: 0 for no, 1 for yes, 2 for yes if it is a steep arm's tip.

    The bits are those of the cell and its neighbours by rows, from the west.
    """
    ring = (5, 8, 7, 6, 3, 0, 1, 2)
    around = sum((bits >> place & 1) << k for k, place in enumerate(ring))
    return int(_is_simple(around)) + int(_is_simple(around) and _is_tip(around))


_REMOVAL = np.array([_removal(bits) for bits in range(512)], np.int8)
ROWS = np.array((0, 1, 1, 1, 0, -1, -1, -1))
COLUMNS = np.array((1, 1, 0, -1, -1, -1, 0, 1))
"""The neighbours of a cell, counter-clockwise from the east."""
_RING = np.array(
    [
        (i, j)
        for i in range(-_NEAR - 1, _NEAR + 2)
        for j in range(-_NEAR - 1, _NEAR + 2)
        if abs(math.hypot(i, j) - _NEAR) <= 0.5
    ]
)
"""Rows and columns to the cells at that distance."""
_RISE = _SLOPE * np.hypot(*_RING.T)


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
def thinned(clearance: np.ndarray) -> np.ndarray:
    """Return the cells of the skeleton (rows, columns)."""
    columns = clearance.shape[1]
    levels = _levels(clearance)
    order, triples = _by_level(levels), _triples(levels)
    one, up = np.uint64(1), np.uint64(columns)
    three, six = np.uint64(3), np.uint64(6)
    # A cell that had to stay may be removed after the cells behind it, so passes are repeated.
    size, left = -1, len(order)
    while left != size:
        size, left = left, 0
        for n in range(size):
            cell = order[n]
            k = np.uint64(cell)  # numba looks for negative indices else.
            bits = triples[k - up] | triples[k] << three | triples[k + up] << six
            removal = _REMOVAL[bits]
            is_removed = removal == 1
            if removal == 2:
                is_removed = _is_steep(clearance, cell // columns, cell % columns)
            if is_removed:
                triples[k - one] &= np.uint8(0b011)
                triples[k] &= np.uint8(0b101)
                triples[k + one] &= np.uint8(0b110)
            else:
                order[left] = cell
                left += 1
    kept = np.zeros(clearance.shape, np.bool_)
    flat = kept.reshape(-1)
    for n in range(left):
        flat[order[n]] = True
    return kept


@kernel(arrays=True)
def _levels(clearance: np.ndarray) -> np.ndarray:
    """Return the clearance in `_BINS` steps per cell, 0 for walls and the outermost cells."""
    rows, columns = clearance.shape
    levels = np.zeros(clearance.shape, np.int32)
    for i in range(1, rows - 1):
        here, away = levels[i, 1:-1], clearance[i, 1:-1]
        for j in range(columns - 2):
            here[j] = np.int32(away[j] * np.float32(_BINS))
    return levels


@kernel(arrays=True)
def _triples(levels: np.ndarray) -> np.ndarray:
    """Return whether each cell and its neighbours to the west and east are free, as three bits.

    The western one comes first. All cells of all rows are in one row.
    """
    triples = np.zeros(levels.size, np.uint8)
    flat = levels.reshape(-1)
    west, here, east, inner = flat[:-2], flat[1:-1], flat[2:], triples[1:-1]
    for k in range(len(inner)):
        inner[k] = np.uint8(west[k] > 0) | np.uint8(here[k] > 0) << 1 | np.uint8(east[k] > 0) << 2
    return triples


@kernel(arrays=True)
def _by_level(levels: np.ndarray) -> np.ndarray:
    """Return the numbers of the cells of a level above 0, those of the lowest level first."""
    flat = levels.reshape(-1)
    most = np.int32(0)
    for k in range(len(flat)):
        most = max(most, flat[k])
    cells, count = np.empty(len(flat), np.int32), 0
    starts = np.zeros(most + 2, np.int64)
    for k in range(len(flat)):
        if flat[k]:
            cells[count] = k
            count += 1
            starts[flat[k] + 1] += 1
    for k in range(1, len(starts)):
        starts[k] += starts[k - 1]
    order = np.empty(count, np.int32)
    for n in range(count):
        level = flat[cells[n]]
        order[starts[level]] = cells[n]
        starts[level] += 1
    return order


@kernel()
def _is_steep(clearance: np.ndarray, row: int, column: int) -> bool:
    """Return whether the clearance grows fast in some direction."""
    rows, columns = clearance.shape
    here = clearance[row, column]
    for n in range(len(_RING)):
        i, j = row + _RING[n, 0], column + _RING[n, 1]
        if 0 <= i < rows and 0 <= j < columns and clearance[i, j] - here > _RISE[n]:
            return True
    return False


@kernel(arrays=True)
def trace_branches(
    kept: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """Return the fields of `Skeleton` with spare rows, and the numbers of cells and branches.

    Nodes are cells with one neighbour or with more than two. Neighbouring nodes make no branch.
    """
    listed = _cells_of(kept)
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


@kernel(arrays=True)
def _cells_of(kept: np.ndarray) -> np.ndarray:
    """Return row and column of the kept cells (cells, 2)."""
    flat, columns = kept.reshape(-1), kept.shape[1]
    count = 0
    for k in range(len(flat)):
        count += flat[k]
    cells, found = np.empty((count, 2), np.int64), 0
    for k in range(len(flat)):
        if flat[k]:
            cells[found, 0], cells[found, 1] = k // columns, k % columns
            found += 1
    return cells


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
        i, j = row + ROWS[n], column + COLUMNS[n]
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
            a, b = i + ROWS[n], j + COLUMNS[n]
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
        here = kept[row + ROWS[n], column + COLUMNS[n]]
        before = kept[row + ROWS[n - 1], column + COLUMNS[n - 1]]
        groups += here and not before
    if groups == 0 and kept[row, column + 1]:
        return 1
    return groups
