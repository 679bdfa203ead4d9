"""Which of the walls expected a wall in view may be matched with, eight at a time. Compiled.

Most walls nearby run otherwise or stand elsewhere. The few that remain are matched one by one, so
what is here decides nothing but the time that matching takes. Walls are the columns of a table
(8, n) with the rows of `lines.measure`; n is a multiple of LANES. Of the table the first `count`
columns are looked at, and those that remain are listed in `near`, ascending.
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
"""Walls are listed that lie farther off than is matched by so much (m): what is computed here is
rounded otherwise."""


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
    """List the walls that run as one in view does, with one end near the same end of it.

    Args:
        table: The walls.
        count: How many they are.
        ends: The ends of the wall in view (m).
        heading: The unit vector along it.
        cosine: Walls are turned by less than the angle of this cosine…
        length: …have this length at least (m)…
        gap: …and an end nearer than this (m).
        near: Is filled.
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
    """List the walls on which points of a wall in view may lie; how many they are.

    Args:
        table: The walls.
        count: How many they are.
        start: The first end of the wall in view (m).
        heading: The unit vector along it.
        first_point: The place along it of its first point (m)…
        last_point: …and of its last.
        cosine: Walls are turned by less than the angle of this cosine.
        gap: A point is no farther from the wall's line than this (m)…
        beyond: …and no farther beyond its ends than this.
        near: Is filled.
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
    # From the first point to the last both grow evenly: how far along the wall a point is, and how
    # far aside of it. So these two points tell of all between.
    dx, dy = x - walls[0], y - walls[1]
    along, aside = walls[6] * dx + walls[7] * dy, walls[6] * dy - walls[7] * dx
    cos, sin = walls[6] * ux + walls[7] * uy, walls[6] * uy - walls[7] * ux
    one, other = aside + first * sin, aside + last * sin
    is_beside = (one.minimum(other) <= gap) & (one.maximum(other) >= -gap)
    is_between = (along + last * cos >= -beyond) & (along + first * cos <= walls[4] + beyond)
    return (cos > cosine) & is_beside & is_between


@kernel()
def _list(bits: int, first: int, near: np.ndarray, count: int) -> int:
    """Append to `near` the columns whose bits are set; how many it holds then."""
    while bits != 0:
        near[count] = first + lowest_bit(bits)
        bits &= bits - 1
        count += 1
    return count
