"""Compiled exact search for the nearest echo, of walls and of corners, in a sonar's cone.

In a sonar's frame, x along its axis, the direction u = (1, t) stands for the bearing with tangent
t. For a wall with ends a and b, a clockwise of b, the part that a sonar may hear is an interval
of t whose bounds are linear in t: the ends (a × u >= 0, u × b >= 0), the cone
(|t| <= tan half), and the two bearings at the specular limit from the wall's perpendicular. The
part that another wall hides is such an interval, too: that wall's ends, and the condition that
it is nearer, with 1/range = n · u / area, n = (b.y - a.y, a.x - b.x) and area = a × b. So no
angle is computed, and divisions are needed only for walls inside the cone.

The nearest point of a wall in an interval is the point nearest to the foot of the
perpendicular. Walls are tried in order of that point's distance. If the point is hidden, the
search continues from it to either side, past the walls that hide it. The first wall whose point
is nearer than all others' points is the echo.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import pseudo_angle
from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import kernel
from albot_core.kernels.simd import (
    LANES,
    FloatTable,
    FloatVector,
    first_bits,
    float64_predicate,
    padded_length,
)
from albot_env.sim.sonar import SonarConstants


class SonarBuffers(NamedTuple):
    """Surfaces in the cones of a robot's sonars, and scratch space."""

    table: np.ndarray
    """(ROWS, columns) float64: all surfaces around the robot, and the surfaces in the cones."""
    bounds: np.ndarray
    """(sonars + 1,) int64: first column of the surfaces in each sonar's cone, which is also the end
    of the previous sonar's."""
    echoes: np.ndarray
    """(sonars, 2) float64: nearest echo of each sonar: range (m), infinite without an echo, and
    tangent of the bearing."""


X1, Y1, X2, Y2, SQUARED, NEAREST, FILLED, BLOCKED = range(8)
"""Rows of the table for all surfaces around the robot: both ends, relative to its centre (m);
the squared distance from there; the minimum squared distance from this block on; and, for
surfaces that fill a sonar's cone, the area and its divisor in the range that they limit."""
AX, AY, BX, BY, AREA, LOW, HIGH, TANGENT, RANGE = range(8, 17)
"""Rows of the table for the surfaces in the cones: ends and area in the sonar's frame; the
interval of tangents that echoes, and its nearest point (see `_find_nearest_points`)."""
ROWS = 17
"""Number of rows of the table."""
Span = tuple[int, int]
"""Surfaces in one sonar's cone: first column, and one past the last."""
_MIN_GAP = 1e-7
"""A gap between walls narrower than this, as a difference of tangents, lets no sound through."""
OCCLUSION_MARGIN = 1.0 + 1e-12
"""A wall hides another that is farther by more than this factor, which exceeds rounding."""
_POINT_MARGIN = 1.0 + 1e-9
"""A wall hides a point that is farther by more than this factor, so not a point that it touches."""
_TOUCH = 1e-6
"""A wall that passes a point within this distance (m) touches the point."""


@kernel(arrays=True)
def make_sonar_buffers(surfaces: int, sonars: int) -> SonarBuffers:
    """Allocate buffers for so many surfaces around a robot and so many sonars."""
    # A packed store into the last columns writes a whole vector.
    columns = max(sonars, 1) * padded_length(surfaces) + LANES
    bounds, echoes = np.zeros(sonars + 1, np.int64), np.empty((sonars, 2))
    return SonarBuffers(np.empty((ROWS, columns)), bounds, echoes)


@kernel()
def find_echoes(buffers: SonarBuffers, sonars: SonarConstants) -> None:
    """Find the nearest echo of each sonar, whose surfaces have been packed."""
    for first in range(0, buffers.bounds[-1], LANES):
        beam = sonars.slope, sonars.cos_limit, sonars.sin_limit
        _find_nearest_points(buffers.table, first, beam)
    for s in range(sonars.mounts.shape[0]):
        cone = buffers.bounds[s], buffers.bounds[s + 1]
        buffers.echoes[s, 0], buffers.echoes[s, 1] = _find_echo(buffers.table, cone, sonars)


@kernel()
def _find_echo(table: np.ndarray, cone: Span, sonars: SonarConstants) -> tuple[float, float]:
    """Return the nearest echo: range (m), infinite without an echo, and tangent of its bearing."""
    best, best_tangent = sonars.max_range, 0.0
    while True:
        # The nearest of the walls not tried yet, if it is nearer than the best echo so far.
        reach, nearest = best, -1
        for first in range(cone[0], cone[1], LANES):
            nearer = _nearest_walls(table, first, (reach, float(cone[1] - first)))
            if nearer:
                nearest = first + lowest_bit(nearer)
                reach = table[RANGE, nearest]
        if nearest < 0:
            break
        visible, slant = _nearest_visible_point(table, cone, nearest)
        if visible < best:
            best, best_tangent = visible, slant
        if visible <= reach:
            break
        table[RANGE, nearest] = np.inf
    if max(sonars.corner_reach, sonars.edge_reach) > 0.0:
        echo = best, best_tangent
        best, best_tangent = _nearest_corner_echo(table, cone, sonars, echo)
    return (best, best_tangent) if best < sonars.max_range else (np.inf, 0.0)


@kernel()
def _wall(table: np.ndarray, j: int) -> tuple[float, float, float, float, float]:
    """Return a wall's ends a and b, and its area."""
    return table[AX, j], table[AY, j], table[BX, j], table[BY, j], table[AREA, j]


@float64_predicate
def _find_nearest_points(table: FloatTable, *beam: FloatVector) -> FloatVector:
    """Find the nearest echo of each wall if nothing hides it; return which walls echo.

    Writes the interval of tangents in which the wall echoes (low >= high if it is empty), and
    the nearest point's tangent and range, infinite if it is empty. `beam` is the tangent of half
    the cone, and the cosine and sine of the specular limit.
    """
    slope, cos, sin = beam
    ax, ay, bx, by, area = (table[row] for row in (AX, AY, BX, BY, AREA))
    nx, ny = by - ay, ax - bx
    low, high = -slope, slope
    # The bounds by both ends, and by the two directions at the specular limit from the
    # perpendicular.
    low, high = _clip_interval(low, high, ax, -ay)
    low, high = _clip_interval(low, high, -bx, by)
    low, high = _clip_interval(low, high, nx * cos + ny * sin, nx * sin - ny * cos)
    low, high = _clip_interval(low, high, ny * sin - nx * cos, ny * cos + nx * sin)
    # If the perpendicular's foot is behind the sonar, take the nearer end of the interval.
    behind = low.where(high, ny < 0.0)
    foot = (ny / nx).where(behind, nx > 0.0)
    tangent = foot.maximum(low).minimum(high)
    heard = ((high - low) > _MIN_GAP) & (area > 0.0)
    reach = area * (tangent * tangent + 1.0).sqrt() / (nx + ny * tangent)
    table[LOW], table[HIGH], table[TANGENT] = low, high, tangent
    table[RANGE] = reach.where(np.inf, heard)
    return heard


@float64_predicate
def _nearest_walls(table: FloatTable, reach: FloatVector, count: FloatVector) -> FloatVector:
    """Return which of the first `count` walls echo nearest, and nearer than `reach`."""
    ranges = table[RANGE]
    ranges = ranges.where(np.inf, ranges.lane_numbers() < count)
    return (ranges < reach) & (ranges <= ranges.reduce_min())


def _clip_interval(
    low: FloatVector, high: FloatVector, slope: FloatVector, offset: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Return the part of intervals of t in which slope t + offset >= 0."""
    bound = -offset / slope
    may = (slope < 0.0) | (slope > 0.0) | (offset >= 0.0)
    low = low.maximum(bound).where(low, slope > 0.0)
    high = high.minimum(bound).where(high, slope < 0.0)
    return low, high.where(-np.inf, may)


@kernel()
def _nearest_visible_point(table: np.ndarray, cone: Span, j: int) -> tuple[float, float]:
    """Return range and tangent of a wall's nearest visible echo; the range is infinite if none."""
    ax, ay, bx, by, area = _wall(table, j)
    low, high, tangent = table[LOW, j], table[HIGH, j], table[TANGENT, j]
    nx, ny = by - ay, ax - bx
    best, best_tangent = np.inf, 0.0
    # If the nearest point is hidden, the wall may be visible on either side of what hides it.
    for side in (1.0, -1.0):
        end = high if side > 0.0 else low
        visible = _end_of_occlusion(table, cone, j, (tangent, side, end))
        if visible == tangent and side * (end - visible) > _MIN_GAP:
            return table[RANGE, j], tangent  # Nothing hides it.
        if side * (end - visible) > _MIN_GAP:
            reach = area * math.sqrt(1.0 + visible * visible) / (nx + ny * visible)
            if reach < best:
                best, best_tangent = reach, visible
    return best, best_tangent


@kernel()
def _end_of_occlusion(
    table: np.ndarray, cone: Span, wall: int, way: tuple[float, float, float]
) -> float:
    """Return the first tangent, from a start to one side (1 or -1), where the wall is visible.

    `way` is the start, the side, and the tangent at which the wall ends. If there is none, the
    result is at or beyond the wall's end. Gaps narrower than _MIN_GAP, as between touching walls,
    are ignored.
    """
    tangent, side, end = way
    ax, ay, bx, by, area = _wall(table, wall)
    nx, ny = by - ay, ax - bx
    while side * (end - tangent) > _MIN_GAP:
        j = _first_occluder(table, cone, wall, (tangent + side * _MIN_GAP, nx, ny, area))
        if j < 0:
            break
        ax, ay, bx, by, its_area = _wall(table, j)
        share = its_area * OCCLUSION_MARGIN
        cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
        ahead = min(_leaving_tangent(ax, -ay, side), _leaving_tangent(-bx, by, side))
        tangent = side * min(ahead, _leaving_tangent(cy, cx, side))
    return tangent


@kernel()
def _first_occluder(
    table: np.ndarray, cone: Span, wall: int, probe: tuple[float, float, float, float]
) -> int:
    """Return the first wall that hides another at `probe` (see `_occluders`), or -1."""
    for first in range(cone[0], cone[1], LANES):
        hiding = _occluders(table, first, probe) & first_bits(cone[1] - first)
        if first <= wall < first + LANES:
            hiding &= ~(1 << (wall - first))
        if hiding:
            return first + lowest_bit(hiding)
    return -1


@float64_predicate
def _occluders(
    table: FloatTable, tangent: FloatVector, nx: FloatVector, ny: FloatVector, area: FloatVector
) -> FloatVector:
    """Return which walls are nearer, at a tangent, than the wall with this normal and area."""
    ax, ay, bx, by, its_area = (table[row] for row in (AX, AY, BX, BY, AREA))
    share = its_area * OCCLUSION_MARGIN
    cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
    between = (ax * tangent >= ay) & (by >= bx * tangent) & (its_area > 0.0)
    return between & (cx + cy * tangent > 0.0)


@kernel()
def _leaving_tangent(slope: float, offset: float, side: float) -> float:
    """Return side times the t where slope t + offset >= 0 ceases to hold towards that side."""
    return -side * offset / slope if slope * side < 0.0 else np.inf


@kernel()
def _nearest_corner_echo(
    table: np.ndarray, cone: Span, sonars: SonarConstants, best: tuple[float, float]
) -> tuple[float, float]:
    """Return range (m) and tangent of the nearest corner or edge echo, else the best so far.

    Corners and edges are points where walls meet or end. The echo of a point depends on its
    opening: the angle, on the sonar's side, between the two walls next to the line of sight. A
    right angle returns sound to where it came from, off one wall and then the other, from any
    direction. A corner that differs from a right angle by δ returns it 2 δ off, like a wall hit
    δ from its perpendicular, so the same limit applies. If the opening exceeds a half turn, the
    point is an edge or a wall's end. Sound bends around these weakly, so they are heard only from
    near (Kuc and Siegel, Physically based simulation model for acoustic sensor robot navigation,
    IEEE Trans. Pattern Analysis and Machine Intelligence 9(6), 1987: planes and right-angled
    corners echo alike, edges far more weakly).

    Args:
        table: The surfaces in the sonars' cones (see `SonarBuffers`).
        cone: Columns of the surfaces in this sonar's cone.
        sonars: The sonars.
        best: Range (m) of the nearest echo so far, and tangent of its bearing.
    """
    slope, specular = sonars.slope, (sonars.cos_limit, sonars.sin_limit)
    reaches = sonars.corner_reach, sonars.edge_reach
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
            if distance >= best[0] or _is_occluded(table, cone, x, y):
                continue
            across, along = _opening_angle(table, cone, first, x, y)
            if distance < _corner_reach(across, along, specular, reaches):
                best = distance, y / x
    return best


@float64_predicate
def _ends_in(
    table: FloatTable, slope: FloatVector, bound: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Return which ends a, and which b, are in the cone with a squared distance below `bound`."""
    return _is_in(table[AX], table[AY], slope, bound), _is_in(table[BX], table[BY], slope, bound)


def _is_in(x: FloatVector, y: FloatVector, slope: FloatVector, bound: FloatVector) -> FloatVector:
    rim = slope * x
    return (x > 0.0) & (y <= rim) & (y >= -rim) & (x * x + y * y < bound)


@float64_predicate
def _ends_at(table: FloatTable, x: FloatVector, y: FloatVector) -> tuple[FloatVector, FloatVector]:
    """Return which ends a, and which ends b, are the point (x, y)."""
    return _is_at(table[AX], table[AY], x, y), _is_at(table[BX], table[BY], x, y)


def _is_at(x: FloatVector, y: FloatVector, px: FloatVector, py: FloatVector) -> FloatVector:
    return (x <= px) & (x >= px) & (y <= py) & (y >= py)


@kernel()
def _corner_reach(
    across: float, along: float, specular: tuple[float, float], reaches: tuple[float, float]
) -> float:
    """Return the distance (m) up to which a point is heard, from its opening's sine and cosine."""
    if along < 0.0 and abs(across) <= -_TOUCH * along:
        return 0.0  # a straight wall
    if across > 0.0:
        return reaches[0] if abs(along) * specular[0] <= across * specular[1] else 0.0
    return reaches[1] if across < 0.0 or along > 0.0 else 0.0


@kernel()
def _opening_angle(
    table: np.ndarray, cone: Span, block: int, x: float, y: float
) -> tuple[float, float]:
    """Return the opening at a wall's end (x, y), on the sonar's side, between the touching walls.

    Returns its sine and cosine, times both walls' lengths (m²). The opening is a full turn at the
    end of a single wall. Both are 0 if a wall in a column before `block` ends there too, because
    the point was then handled with that wall.
    """
    # The nearest walls counter-clockwise and clockwise of the line to the sonar.
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
                    turn = 2.0 + pseudo_angle(x * px + y * py, x * py - y * px)
                    if turn < left:
                        left, left_x, left_y = turn, px, py
                    if turn > right:
                        right, right_x, right_y = turn, px, py
    return right_x * left_y - right_y * left_x, right_x * left_x + right_y * left_y


@float64_predicate
def _touching(table: FloatTable, x: FloatVector, y: FloatVector) -> FloatVector:
    """Return which surfaces pass the point (x, y) within _TOUCH (m)."""
    ax, ay, bx, by = table[AX] - x, table[AY] - y, table[BX] - x, table[BY] - y
    dx, dy, across = bx - ax, by - ay, ax * by - ay * bx
    beside = (ax.minimum(bx) <= _TOUCH) & (ax.maximum(bx) >= -_TOUCH)
    beside &= (ay.minimum(by) <= _TOUCH) & (ay.maximum(by) >= -_TOUCH)
    return beside & (across * across <= (dx * dx + dy * dy) * (_TOUCH * _TOUCH))


@kernel()
def _is_occluded(table: np.ndarray, cone: Span, x: float, y: float) -> bool:
    """Whether a wall stands between the sonar and the point (x, y)."""
    hiding = 0
    for first in range(cone[0], cone[1], LANES):
        hiding |= _point_occluders(table, first, (x, y)) & first_bits(cone[1] - first)
    return hiding != 0


@float64_predicate
def _point_occluders(table: FloatTable, x: FloatVector, y: FloatVector) -> FloatVector:
    """Return which surfaces stand between the sonar and the point (x, y)."""
    ax, ay, bx, by, area = (table[row] for row in (AX, AY, BX, BY, AREA))
    between = (ax * y >= ay * x) & (by * x >= bx * y) & (area > 0.0)
    return between & ((by - ay) * x + (ax - bx) * y > area * _POINT_MARGIN)
