"""The expected walls that a wall in view may match, eight tested at a time. Compiled.

Most walls nearby have another direction or stand elsewhere. The few that remain are compared one by
one, so this file affects only the time that matching takes, not its result. Walls are the columns
of a table (8, n) with the rows of `lines.measure`; n is a multiple of LANES. The first `count`
columns of the table are tested, and those that remain are listed in `near`, in ascending order.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.kernels.simd import (
    LANES,
    FloatTable,
    FloatVector,
    first_bits,
    float64_predicate,
)
from albot_core.matching.lines import Ends

ROUNDING = 1e-9
"""Walls are listed up to this much farther away than they are matched (m), because the rounding
here differs from that of matching."""


@kernel()
def tabulate(rows: np.ndarray, table: np.ndarray) -> None:
    """Write the walls' rows (n, 8) into the first columns of the table."""
    for k in range(rows.shape[0]):
        for i in range(8):
            table[i, k] = rows[k, i]


@kernel()
def list_ends_near(
    table: np.ndarray,
    count: int,
    ends: Ends,
    heading: tuple[float, float],
    cosine: float,
    length: float,
    gap: float,
    near: np.ndarray,
) -> int:
    """List the walls with the direction of a wall in view and an end near the same end of it.

    Args:
        table: The walls.
        count: Number of walls.
        ends: The ends of the wall in view (m).
        heading: The unit vector along it.
        cosine: Cosine of the largest angle between the two walls.
        length: Minimum length of a wall (m).
        gap: Maximum distance between the two ends (m).
        near: Filled with the columns of the walls.

    Returns:
        The number of walls listed.
    """
    found, least = ZERO, (cosine, length, gap * gap)
    for first in range(0, count, LANES):
        bits = _has_end_near(table, first, (*ends, *heading, *least)) & first_bits(count - first)
        found = _list(bits, first, near, found)
    return int(found)


@float64_predicate
def _has_end_near(
    walls: FloatTable,
    x1: FloatVector,
    y1: FloatVector,
    x2: FloatVector,
    y2: FloatVector,
    ux: FloatVector,
    uy: FloatVector,
    cosine: FloatVector,
    length: FloatVector,
    square: FloatVector,
) -> FloatVector:
    dx1, dy1, dx2, dy2 = x1 - walls[0], y1 - walls[1], x2 - walls[2], y2 - walls[3]
    is_near = (dx1 * dx1 + dy1 * dy1 < square) | (dx2 * dx2 + dy2 * dy2 < square)
    return is_near & (ux * walls[6] + uy * walls[7] > cosine) & (walls[4] >= length)


@kernel()
def list_walls_along(
    table: np.ndarray,
    count: int,
    start: tuple[float, float],
    heading: tuple[float, float],
    first_point: float,
    last_point: float,
    cosine: float,
    gap: float,
    beyond: float,
    near: np.ndarray,
) -> int:
    """List the walls on which points of a wall in view may lie, and return their number.

    Args:
        table: The walls.
        count: Number of walls.
        start: The first end of the wall in view (m).
        heading: The unit vector along it.
        first_point: Distance of its first point from `start` (m).
        last_point: Distance of its last point from `start` (m).
        cosine: Cosine of the largest angle between the two walls.
        gap: Maximum distance of a point from a wall's line (m).
        beyond: Maximum distance of a point beyond a wall's ends (m).
        near: Filled with the columns of the walls.
    """
    found = ZERO
    numbers = (*start, *heading, first_point, last_point, cosine, gap + ROUNDING, beyond + ROUNDING)
    for first in range(0, count, LANES):
        bits = _is_along(table, first, numbers) & first_bits(count - first)
        found = _list(bits, first, near, found)
    return int(found)


@float64_predicate
def _is_along(
    walls: FloatTable,
    x: FloatVector,
    y: FloatVector,
    ux: FloatVector,
    uy: FloatVector,
    first: FloatVector,
    last: FloatVector,
    cosine: FloatVector,
    gap: FloatVector,
    beyond: FloatVector,
) -> FloatVector:
    # From the first point to the last, the positions along and across the wall change linearly, so
    # these two points bound all points between them.
    dx, dy = x - walls[0], y - walls[1]
    along, aside = walls[6] * dx + walls[7] * dy, walls[6] * dy - walls[7] * dx
    cos, sin = walls[6] * ux + walls[7] * uy, walls[6] * uy - walls[7] * ux
    one, other = aside + first * sin, aside + last * sin
    is_beside = (one.minimum(other) <= gap) & (one.maximum(other) >= -gap)
    is_between = (along + last * cos >= -beyond) & (along + first * cos <= walls[4] + beyond)
    return (cos > cosine) & is_beside & is_between


@kernel()
def _list(bits: int, first: int, near: np.ndarray, count: int) -> int:
    """Append to `near` the columns whose bits are set; return the new length of the list."""
    while bits != 0:
        near[count] = first + lowest_bit(bits)
        bits &= bits - 1
        count += 1
    return count
