"""Compiled search for the nearest echo inside a sonar's cone, exactly.

In a sonar's frame, x along its axis, the direction u = (1, t) stands for the bearing whose
tangent is t. Of a wall with ends a and b, a clockwise of b, what a sonar may hear is an
interval of t, each bound of it linear in t: the ends (a × u >= 0, u × b >= 0), the cone
(|t| <= tan half), and the two bearings at the specular limit from the wall's
perpendicular. Where another wall hides it is the same: its ends, and that it is nearer,
for 1/range = n · u / area with n = (b.y - a.y, a.x - b.x) and area = a × b. So no angle
is computed, and nothing is divided but for walls inside the cone.

The nearest point of a wall in an interval is the one nearest to the foot of the
perpendicular. Walls are tried in the order of that point's distance, and where it is
hidden, the search goes on from it to either side, behind what hides it; the first wall
whose point is nearer than all others' is the echo.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import kernel
from albot_core.kernels.simd import LANES, FloatTable, FloatVector, first_bits, float64_predicate
from albot_env.sim.corner_kernels import corner_echo
from albot_env.sim.sonar_arrays import Sonars
from albot_env.sim.surface_kernels import (
    AREA,
    AX,
    AY,
    BX,
    BY,
    HAIR,
    HIGH,
    LOW,
    NEARER,
    RANGE,
    TANGENT,
    Cones,
    Span,
)


@kernel()
def find_echoes(cones: Cones, sonars: Sonars) -> None:
    """Find the nearest echo of each sonar, whose surfaces have been put together."""
    for first in range(0, cones.bounds[-1], LANES):
        beam = sonars.slope, sonars.cos_limit, sonars.sin_limit
        _find_nearest_points(cones.table, first, beam)
    for s in range(sonars.mounts.shape[0]):
        cone = cones.bounds[s], cones.bounds[s + 1]
        cones.echoes[s] = _find_echo(cones.table, cone, sonars)


@kernel()
def _find_echo(table: np.ndarray, cone: Span, sonars: Sonars) -> tuple[float, float]:
    """Range (m) of the nearest echo, infinite where there is none, and tangent of its bearing."""
    best, best_tangent = sonars.max_range, 0.0
    while True:
        # The nearest of the walls that were not tried yet, if it is nearer than the best.
        reach, nearest = best, -1
        for first in range(cone[0], cone[1], LANES):
            nearer = _nearest(table, first, (reach, float(cone[1] - first)))
            if nearer:
                nearest = first + lowest_bit(nearer)
                reach = table[RANGE, nearest]
        if nearest < 0:
            break
        shown, slant = _shown_point(table, cone, nearest)
        if shown < best:
            best, best_tangent = shown, slant
        if shown <= reach:
            break
        table[RANGE, nearest] = np.inf
    if max(sonars.corner_reach, sonars.edge_reach) > 0.0:
        specular = sonars.cos_limit, sonars.sin_limit
        reaches = sonars.corner_reach, sonars.edge_reach
        echo = best, best_tangent
        best, best_tangent = corner_echo(table, cone, sonars.slope, specular, reaches, echo)
    return (best, best_tangent) if best < sonars.max_range else (np.inf, 0.0)


@kernel()
def _wall(table: np.ndarray, j: int) -> tuple[float, float, float, float, float]:
    """A wall's ends a and b, and its area."""
    return table[AX, j], table[AY, j], table[BX, j], table[BY, j], table[AREA, j]


@float64_predicate
def _find_nearest_points(table: FloatTable, *beam: FloatVector) -> FloatVector:
    """Find of each wall where it echoes nearest if nothing hides it; which do so at all.

    Written are the tangents between which it could be heard (low >= high where it could not), and
    the nearest point's tangent and range, infinite where there is none. `beam` is the tangent of
    half the cone, and the cosine and sine of the specular limit.
    """
    slope, cos, sin = beam
    ax, ay, bx, by, area = (table[row] for row in (AX, AY, BX, BY, AREA))
    nx, ny = by - ay, ax - bx
    low, high = -slope, slope
    # Both ends; and u from the perpendicular turned clockwise by the limit to it turned the
    # other way.
    low, high = _bounded(low, high, ax, -ay)
    low, high = _bounded(low, high, -bx, by)
    low, high = _bounded(low, high, nx * cos + ny * sin, nx * sin - ny * cos)
    low, high = _bounded(low, high, ny * sin - nx * cos, ny * cos + nx * sin)
    # With the perpendicular's foot behind the sonar, the nearer end of the span.
    behind = low.where(high, ny < 0.0)
    foot = (ny / nx).where(behind, nx > 0.0)
    tangent = foot.maximum(low).minimum(high)
    heard = ((high - low) > HAIR) & (area > 0.0)
    reach = area * (tangent * tangent + 1.0).sqrt() / (nx + ny * tangent)
    table[LOW], table[HIGH], table[TANGENT] = low, high, tangent
    table[RANGE] = reach.where(np.inf, heard)
    return heard


@float64_predicate
def _nearest(table: FloatTable, reach: FloatVector, count: FloatVector) -> FloatVector:
    """Which walls of the first so many echo nearest, if nearer than a reach."""
    ranges = table[RANGE]
    ranges = ranges.where(np.inf, ranges.lane_numbers() < count)
    return (ranges < reach) & (ranges <= ranges.reduce_min())


def _bounded(
    low: FloatVector, high: FloatVector, slope: FloatVector, offset: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """The part of intervals of t in which slope t + offset >= 0."""
    bound = -offset / slope
    may = (slope < 0.0) | (slope > 0.0) | (offset >= 0.0)
    low = low.maximum(bound).where(low, slope > 0.0)
    high = high.minimum(bound).where(high, slope < 0.0)
    return low, high.where(-np.inf, may)


@kernel()
def _shown_point(table: np.ndarray, cone: Span, j: int) -> tuple[float, float]:
    """Range and tangent of a wall's nearest point that echoes and is not hidden; or infinite."""
    ax, ay, bx, by, area = _wall(table, j)
    low, high, tangent = table[LOW, j], table[HIGH, j], table[TANGENT, j]
    nx, ny = by - ay, ax - bx
    best, best_tangent = np.inf, 0.0
    for side in (1.0, -1.0):
        end = high if side > 0.0 else low
        shown = _emerge(table, cone, j, (tangent, side, end))
        if shown == tangent and side * (end - shown) > HAIR:
            return table[RANGE, j], tangent  # Nothing hides it.
        if side * (end - shown) > HAIR:
            reach = area * math.sqrt(1.0 + shown * shown) / (nx + ny * shown)
            if reach < best:
                best, best_tangent = reach, shown
    return best, best_tangent


@kernel()
def _emerge(table: np.ndarray, cone: Span, wall: int, way: tuple[float, float, float]) -> float:
    """From a tangent on to one side (1 or -1), the first where nothing hides the wall.

    `way` is that tangent, the side, and the tangent at which the wall ends. At or beyond that where
    there is none. A gap narrower than HAIR, as between walls that touch, is none.
    """
    tangent, side, end = way
    ax, ay, bx, by, area = _wall(table, wall)
    nx, ny = by - ay, ax - bx
    while side * (end - tangent) > HAIR:
        j = _nearer(table, cone, wall, (tangent + side * HAIR, nx, ny, area))
        if j < 0:
            break
        ax, ay, bx, by, its_area = _wall(table, j)
        share = its_area * NEARER
        cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
        ahead = min(_leave(ax, -ay, side), _leave(-bx, by, side))
        tangent = side * min(ahead, _leave(cy, cx, side))
    return tangent


@kernel()
def _nearer(
    table: np.ndarray, cone: Span, wall: int, probe: tuple[float, float, float, float]
) -> int:
    """The first wall that hides another at a tangent, or -1; `probe` is what `_hiding` takes."""
    for first in range(cone[0], cone[1], LANES):
        hiding = _hiding(table, first, probe) & first_bits(cone[1] - first)
        if first <= wall < first + LANES:
            hiding &= ~(1 << (wall - first))
        if hiding:
            return first + lowest_bit(hiding)
    return -1


@float64_predicate
def _hiding(
    table: FloatTable, tangent: FloatVector, nx: FloatVector, ny: FloatVector, area: FloatVector
) -> FloatVector:
    """Which walls are nearer at a tangent than the one with this normal and area."""
    ax, ay, bx, by, its_area = (table[row] for row in (AX, AY, BX, BY, AREA))
    share = its_area * NEARER
    cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
    between = (ax * tangent >= ay) & (by >= bx * tangent) & (its_area > 0.0)
    return between & (cx + cy * tangent > 0.0)


@kernel()
def _leave(slope: float, offset: float, side: float) -> float:
    """Where, going to one side, slope t + offset >= 0 ends to hold: side times that t."""
    return -side * offset / slope if slope * side < 0.0 else np.inf
