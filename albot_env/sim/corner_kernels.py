"""Compiled echoes of corners and edges, the points where walls meet or end.

What a point echoes depends on its opening: the angle, on the sonar's side, between the two
walls next to the line of sight. A right angle sends sound back the way it came, off one
wall and then the other, from wherever it comes; a corner that is off a right angle by δ
sends it 2 δ off, as a wall does that is hit δ from its perpendicular, so that the same limit
holds. Beyond a half turn the point is an edge or a wall's end, which sound bends around:
weakly, so that it is heard from near only (Kuc and Siegel, Physically based simulation model
for acoustic sensor robot navigation, IEEE Trans. Pattern Analysis and Machine Intelligence
9(6), 1987: echoes of planes and right-angled corners alike, those of edges far weaker).
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.directions import turned
from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import kernel
from albot_core.kernels.simd import LANES, FloatTable, FloatVector, first_bits, float64_predicate
from albot_env.sim.surface_kernels import AREA, AX, AY, BX, BY, Span

_BEYOND = 1.0 + 1e-9
"""A wall is between when the point is this much farther, so not one that touches it."""
_TOUCH = 1e-6
"""A wall that passes a point no farther than this (m) touches it."""


@kernel()
def corner_echo(
    table: np.ndarray,
    cone: Span,
    slope: float,
    specular: tuple[float, float],
    reaches: tuple[float, float],
    best: tuple[float, float],
) -> tuple[float, float]:
    """Range (m) and tangent of the nearest corner or edge that echoes, or else the best so far.

    Args:
        table: The surfaces in the sonars' cones (see `Cones`).
        cone: Which of them are in this sonar's.
        slope: Tangent of half the cone.
        specular: Cosine and sine of the specular limit.
        reaches: Distances (m) up to which corners and edges echo.
        best: Range (m) of the nearest echo so far, and tangent of its bearing.
    """
    farthest = max(reaches[0], reaches[1])
    for first in range(cone[0], cone[1], LANES):
        bound = min(best[0], farthest)
        points = _ends_in(table, first, (slope, bound * bound))
        points &= first_bits(cone[1] - first) * (1 << LANES | 1)
        while points:
            lane = lowest_bit(points)
            j, end = first + lane % LANES, lane // LANES
            x, y = table[AX + 2 * end, j], table[AY + 2 * end, j]
            points &= ~_ends_at(table, first, (x, y))
            distance = math.sqrt(x * x + y * y)
            if distance >= best[0] or _is_hidden(table, cone, x, y):
                continue
            across, along = _opening(table, cone, first, x, y)
            if distance < _reach_of(across, along, specular, reaches):
                best = distance, y / x
    return best


@float64_predicate
def _ends_in(
    table: FloatTable, slope: FloatVector, bound: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Which surfaces' ends a, and b, are in the cone, nearer than the square root of the bound."""
    return _is_in(table[AX], table[AY], slope, bound), _is_in(table[BX], table[BY], slope, bound)


def _is_in(x: FloatVector, y: FloatVector, slope: FloatVector, bound: FloatVector) -> FloatVector:
    rim = slope * x
    return (x > 0.0) & (y <= rim) & (y >= -rim) & (x * x + y * y < bound)


@float64_predicate
def _ends_at(table: FloatTable, x: FloatVector, y: FloatVector) -> tuple[FloatVector, FloatVector]:
    """Which surfaces' ends a, and b, are the point (x, y)."""
    return _is_at(table[AX], table[AY], x, y), _is_at(table[BX], table[BY], x, y)


def _is_at(x: FloatVector, y: FloatVector, px: FloatVector, py: FloatVector) -> FloatVector:
    return (x <= px) & (x >= px) & (y <= py) & (y >= py)


@kernel()
def _reach_of(
    across: float, along: float, specular: tuple[float, float], reaches: tuple[float, float]
) -> float:
    """From how far (m) a point is heard, by the sine and cosine of its opening, times an area."""
    if along < 0.0 and abs(across) <= -_TOUCH * along:
        return 0.0  # a straight wall
    if across > 0.0:
        return reaches[0] if abs(along) * specular[0] <= across * specular[1] else 0.0
    return reaches[1] if across < 0.0 or along > 0.0 else 0.0


@kernel()
def _opening(table: np.ndarray, cone: Span, block: int, x: float, y: float) -> tuple[float, float]:
    """The angle, on the sonar's side, between the walls that touch a wall's end (x, y).

    Told by its sine and cosine, times the lengths of both (m²). A full turn at the end of a
    single wall; both 0 where one before those of a block, given by its first, ends there too: with
    that the point was looked at.
    """
    # The next walls counter-clockwise and clockwise of the line to the sonar.
    left, left_x, left_y = np.inf, 0.0, 0.0
    right, right_x, right_y = -np.inf, 0.0, 0.0
    for first in range(cone[0], cone[1], LANES):
        touching = _touching(table, first, (x, y)) & first_bits(cone[1] - first)
        while touching:
            j = first + lowest_bit(touching)
            touching &= touching - 1
            for end in range(2):
                px, py = table[AX + 2 * end, j] - x, table[AY + 2 * end, j] - y
                if j < block and px == 0.0 and py == 0.0:
                    return 0.0, 0.0
                if px * px + py * py > _TOUCH * _TOUCH:
                    # From 0 to 4, counter-clockwise from the direction to the sonar, (-x, -y).
                    turn = 2.0 + turned(x * px + y * py, x * py - y * px)
                    if turn < left:
                        left, left_x, left_y = turn, px, py
                    if turn > right:
                        right, right_x, right_y = turn, px, py
    return right_x * left_y - right_y * left_x, right_x * left_x + right_y * left_y


@float64_predicate
def _touching(table: FloatTable, x: FloatVector, y: FloatVector) -> FloatVector:
    """Which surfaces pass the point (x, y) no farther than _TOUCH (m)."""
    ax, ay, bx, by = table[AX] - x, table[AY] - y, table[BX] - x, table[BY] - y
    dx, dy, across = bx - ax, by - ay, ax * by - ay * bx
    beside = (ax.minimum(bx) <= _TOUCH) & (ax.maximum(bx) >= -_TOUCH)
    beside &= (ay.minimum(by) <= _TOUCH) & (ay.maximum(by) >= -_TOUCH)
    return beside & (across * across <= (dx * dx + dy * dy) * (_TOUCH * _TOUCH))


@kernel()
def _is_hidden(table: np.ndarray, cone: Span, x: float, y: float) -> bool:
    """Whether a wall stands between the sonar and the point (x, y)."""
    hiding = 0
    for first in range(cone[0], cone[1], LANES):
        hiding |= _hiding(table, first, (x, y)) & first_bits(cone[1] - first)
    return hiding != 0


@float64_predicate
def _hiding(table: FloatTable, x: FloatVector, y: FloatVector) -> FloatVector:
    """Which surfaces stand between the sonar and the point (x, y)."""
    ax, ay, bx, by, area = (table[row] for row in (AX, AY, BX, BY, AREA))
    between = (ax * y >= ay * x) & (by * x >= bx * y) & (area > 0.0)
    return between & ((by - ay) * x + (ax - bx) * y > area * _BEYOND)
