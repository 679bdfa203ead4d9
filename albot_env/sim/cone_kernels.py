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

from albot_core.compiled import kernel
from albot_env.sim.corner_kernels import corner_echo
from albot_env.sim.lanes import LANES, Lanes, Table, lowest, question
from albot_env.sim.sonar_arrays import Sonars
from albot_env.sim.surface_kernels import (
    AREA,
    AX,
    AY,
    BX,
    BY,
    FIRST,
    HAIR,
    INSIDE,
    NEARER,
    Cone,
    bounded,
)


@kernel()
def find_echo(cone: Cone, sonars: Sonars) -> tuple[float, float]:
    """Range (m) of the nearest echo, infinite where there is none, and tangent of its bearing."""
    table, blocks = cone.table, cone.blocks
    best, best_tangent = sonars.max_range, 0.0
    beam = sonars.slope, sonars.cos_limit, sonars.sin_limit
    tried, last = -1.0, -1
    while True:
        # The nearest of the walls that were not tried yet, if it is nearer than the best.
        reach, tangent, nearest = best, 0.0, -1
        for block in range(cone.noted[0]):
            first = blocks[FIRST, block]
            likely = _likely(table, first, (reach * reach, *sonars.lean)) & blocks[INSIDE, block]
            while likely:
                j = first + lowest(likely)
                likely &= likely - 1
                ax, ay, bx, by, area = _wall(table, j)
                nx, ny = by - ay, ax - bx
                if area * area >= reach * reach * (nx * nx + ny * ny):
                    continue
                found, slant = _nearest_point(ax, ay, bx, by, area, beam)
                if found < reach and (found > tried or (found == tried and j > last)):
                    reach, tangent, nearest = found, slant, j
        if nearest < 0:
            break
        shown, slant = _shown_point(cone, nearest, beam, tangent)
        if shown < best:
            best, best_tangent = shown, slant
        if shown <= reach:
            break
        tried, last = reach, nearest
    if max(sonars.corner_reach, sonars.edge_reach) > 0.0:
        specular = sonars.cos_limit, sonars.sin_limit
        reaches = sonars.corner_reach, sonars.edge_reach
        best, best_tangent = corner_echo(cone, sonars.slope, specular, reaches, best, best_tangent)
    return (best, best_tangent) if best < sonars.max_range else (np.inf, 0.0)


@kernel()
def _wall(table: np.ndarray, j: int) -> tuple[float, float, float, float, float]:
    """A wall's ends a and b, and its area."""
    return table[AX, j], table[AY, j], table[BX, j], table[BY, j], table[AREA, j]


@question
def _likely(table: Table, reach2: Lanes, cos: Lanes, sin: Lanes) -> Lanes:
    """Which walls may be heard within a reach, whose square is given.

    Most are too far by their perpendicular, or it points too far away from the sonar's axis:
    nothing need be divided to tell.
    """
    nx, ny, area = table[BY] - table[AY], table[AX] - table[BX], table[AREA]
    facing = (ny * cos <= nx * sin) & (ny * cos >= nx * sin * -1.0)
    return facing & (area * area < reach2 * (nx * nx + ny * ny))


@kernel()
def _span(
    ax: float, ay: float, bx: float, by: float, beam: tuple[float, float, float]
) -> tuple[float, float]:
    """Between which tangents a wall could be heard if nothing hid it; empty where low >= high."""
    slope, cos, sin = beam
    low, high = -slope, slope
    low, high = bounded(low, high, ax, -ay)
    low, high = bounded(low, high, -bx, by)
    # u from the perpendicular turned clockwise by the limit to it turned the other way.
    nx, ny = by - ay, ax - bx
    low, high = bounded(low, high, nx * cos + ny * sin, nx * sin - ny * cos)
    return bounded(low, high, ny * sin - nx * cos, ny * cos + nx * sin)


@kernel()
def _nearest_point(
    ax: float, ay: float, bx: float, by: float, area: float, beam: tuple[float, float, float]
) -> tuple[float, float]:
    """Range and tangent of the nearest point of a wall that echoes, if nothing hides it.

    Infinite where there is none. `beam` is the tangent of half the cone, and the cosine and
    sine of the specular limit.
    """
    low, high = _span(ax, ay, bx, by, beam)
    if area == 0.0 or not high - low > HAIR:
        return np.inf, 0.0
    nx, ny = by - ay, ax - bx
    # With the perpendicular's foot behind the sonar, the nearer end of the span.
    foot = ny / nx if nx > 0.0 else math.copysign(np.inf, ny)
    tangent = min(max(foot, low), high)
    return area * math.sqrt(1.0 + tangent * tangent) / (nx + ny * tangent), tangent


@kernel()
def _shown_point(
    cone: Cone, j: int, beam: tuple[float, float, float], tangent: float
) -> tuple[float, float]:
    """Range and tangent of a wall's nearest point that echoes and is not hidden.

    `tangent` is that of the nearest point if nothing hid it; infinite where all is hidden.
    """
    ax, ay, bx, by, area = _wall(cone.table, j)
    low, high = _span(ax, ay, bx, by, beam)
    nx, ny = by - ay, ax - bx
    best, best_tangent = np.inf, 0.0
    for side in (1.0, -1.0):
        end = high if side > 0.0 else low
        shown = _emerge(cone, j, tangent, side, end)
        if side * (end - shown) > HAIR:
            reach = area * math.sqrt(1.0 + shown * shown) / (nx + ny * shown)
            if reach < best:
                best, best_tangent = reach, shown
            if shown == tangent:
                break  # nothing hides it, and nothing on the other side is nearer
    return best, best_tangent


@kernel()
def _emerge(cone: Cone, wall: int, tangent: float, side: float, end: float) -> float:
    """From a tangent on to one side (1 or -1), the first where nothing hides the wall.

    At or beyond `end` where there is none. A gap narrower than HAIR, as between walls
    that touch, is none.
    """
    ax, ay, bx, by, area = _wall(cone.table, wall)
    nx, ny = by - ay, ax - bx
    while side * (end - tangent) > HAIR:
        j = _nearer(cone, wall, (tangent + side * HAIR, nx, ny, area))
        if j < 0:
            break
        ax, ay, bx, by, its_area = _wall(cone.table, j)
        share = its_area * NEARER
        cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
        ahead = min(_leave(ax, -ay, side), _leave(-bx, by, side))
        tangent = side * min(ahead, _leave(cy, cx, side))
    return tangent


@kernel()
def _nearer(cone: Cone, wall: int, probe: tuple[float, float, float, float]) -> int:
    """The first wall that hides another at a tangent, or -1; `probe` is what `_hiding` takes."""
    for block in range(cone.noted[0]):
        first = int(cone.blocks[FIRST, block])
        hiding = _hiding(cone.table, first, probe) & cone.blocks[INSIDE, block]
        if first <= wall < first + LANES:
            hiding &= ~(1 << (wall - first))
        if hiding:
            return first + lowest(hiding)
    return -1


@question
def _hiding(table: Table, tangent: Lanes, nx: Lanes, ny: Lanes, area: Lanes) -> Lanes:
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
