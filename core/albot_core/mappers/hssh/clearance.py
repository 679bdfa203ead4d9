"""The clearance of free ground: the distance of each cell to the nearest wall. Compiled."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float32

from albot_core.kernels.compiled import kernel

_FAR = np.int32(1 << 30)
"""Square of a distance beyond all others (cells²)."""


@kernel(arrays=True)
def sealed(free: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "rows columns"]:
    """Return the free cells without those that touch another one between two corners of a wall.

    A thin wall that runs aslant is a chain of cells that touch by their corners. The skeleton is
    8-connected, and would lead through it.
    """
    kept = free.copy()
    rows = kept.shape[0]
    # Rows that may have such cells, with the row after.
    is_due = np.ones(rows, np.bool_)
    changed = True
    while changed:
        changed = False
        for i in range(rows - 1):
            if is_due[i]:
                is_due[i] = False
                if _touch(kept[i], kept[i + 1]) and _seal(kept[i], kept[i + 1]):
                    changed = is_due[i] = is_due[max(i - 1, 0)] = True
    return kept


@kernel()
def _touch(row: np.ndarray, following: np.ndarray) -> bool:
    """Return whether cells of two rows touch by their corners alone.

    Without branches, so that many cells are compared at once.
    """
    a, b, c, d = row[:-1], row[1:], following[:-1], following[1:]
    found = False
    for j in range(len(a)):
        one, other = a[j] & d[j], b[j] & c[j]
        found |= (one & (not b[j]) & (not c[j])) | (other & (not a[j]) & (not d[j]))
    return found


@kernel()
def _seal(row: np.ndarray, following: np.ndarray) -> bool:
    """Remove the cells of a row that touch one of the following row by their corners alone.

    Returns:
        Whether there are any.
    """
    changed = False
    for j in range(len(row) - 1):
        one, other = row[j] and following[j + 1], row[j + 1] and following[j]
        if one and not row[j + 1] and not following[j]:
            row[j], changed = False, True
        elif other and not row[j] and not following[j + 1]:
            row[j + 1], changed = False, True
    return changed


@kernel(arrays=True)
def distances(free: Bool[np.ndarray, "rows columns"]) -> Float32[np.ndarray, "rows columns"]:
    """Return the distance of each free cell to the nearest cell that is not free (cells).

    First within columns, then within rows (T. Saito and J. Toriwaki, New algorithms for Euclidean
    distance transformation, Pattern Recognition 1994). Without any such cell the distances are
    those to beyond the grid.
    """
    rows, columns = free.shape
    squares = _squares_within_columns(free)
    found = np.zeros(free.shape, np.float32)
    padded, least = np.empty(3 * columns, np.int32), np.empty(columns, np.int32)
    for i in range(rows):
        line, stop = free[i], 0
        while stop < columns:
            # A run of free cells and the cells at its ends: nothing beyond those is nearer.
            start = stop
            while start < columns and not line[start]:
                start += 1
            stop = start
            while stop < columns and line[stop]:
                stop += 1
            if start < stop:
                first, last = max(start - 1, 0), min(stop + 1, columns)
                _nearest_in_row(squares[i, first:last], padded, least, found[i, first:last])
    return found


@kernel(arrays=True)
def _squares_within_columns(free: np.ndarray) -> np.ndarray:
    """Return the squared distance of each cell to the nearest in its column that is not free.

    It goes row by row, as the cells lie in memory.
    """
    rows, columns = free.shape
    far, one, zero = np.int32(rows + columns), np.int32(1), np.int32(0)
    away = np.empty(free.shape, np.int32)
    for j in range(columns):
        away[0, j] = far if free[0, j] else zero
    for i in range(1, rows):
        line, here, before = free[i], away[i], away[i - 1]
        for j in range(columns):
            # The sum of two int32 is an int64, of which fewer are computed at once.
            more = min(np.int32(before[j] + one), far)
            here[j] = more if line[j] else zero
    for i in range(rows - 2, -1, -1):
        here, before = away[i], away[i + 1]
        for j in range(columns):
            here[j] = min(here[j], np.int32(before[j] + one))
    flat = away.reshape(-1)
    for k in range(len(flat)):
        flat[k] *= flat[k]
    return away


@kernel()
def _nearest_in_row(
    squares: np.ndarray, padded: np.ndarray, least: np.ndarray, found: np.ndarray
) -> None:
    """Find the distances of successive cells of a row, all of them at once, step by step.

    Args:
        squares: Squared distance of each cell to the nearest one in its column (n,) (cells²).
        padded: Scratch buffer (3 n,).
        least: Scratch buffer (n,).
        found: Output: the distances (n,).
    """
    count = len(squares)
    inner, beyond = padded[count:], padded[2 * count :]
    most = np.int32(0)
    for j in range(count):
        padded[j] = beyond[j] = _FAR
        inner[j] = least[j] = squares[j]
        most = max(most, squares[j])
    step = 1
    while step < count and step * step < most:
        square, left, right = np.int32(step * step), padded[count - step :], padded[count + step :]
        most = np.int32(0)
        for j in range(count):
            nearer = min(least[j], np.int32(min(left[j], right[j]) + square))
            least[j] = nearer
            most = max(most, nearer)
        step += 1
    for j in range(count):
        found[j] = math.sqrt(np.float32(least[j]))
