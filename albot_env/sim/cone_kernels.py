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
whose point is nearer than all others' is the echo. It goes fastest with the near walls
first in the list. `seen` are the walls in the cone (see `surface_kernels`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from albot_env.sim.corner_kernels import corner_echo
from albot_env.sim.sonar_arrays import Sonars
from albot_env.sim.surface_kernels import AREA, AX, AY, BX, BY, HAIR, NEARER, bounded


@njit(cache=True, error_model="numpy")
def find_echo(seen: np.ndarray, count: int, sonars: Sonars) -> tuple[float, float]:
    """Range (m) of the nearest echo, infinite where there is none, and tangent of its bearing."""
    best, best_tangent = sonars.max_range, 0.0
    beam = sonars.slope, sonars.cos_limit, sonars.sin_limit
    tried, last = -1.0, -1
    while True:
        # The nearest of the walls that were not tried yet, if it is nearer than the best.
        reach, tangent, nearest = best, 0.0, -1
        for j in range(count):
            ax, ay, bx, by = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j]
            nx, ny, area = by - ay, ax - bx, seen[AREA, j]
            # Most are too far by their perpendicular, for which nothing need be divided.
            if area * area >= reach * reach * (nx * nx + ny * ny):
                continue
            found, slant = _nearest_point(ax, ay, bx, by, area, beam)
            if found < reach and (found > tried or (found == tried and j > last)):
                reach, tangent, nearest = found, slant, j
        if nearest < 0:
            break
        shown, slant = _shown_point(seen, count, nearest, beam, tangent)
        if shown < best:
            best, best_tangent = shown, slant
        if shown <= reach:
            break
        tried, last = reach, nearest
    if max(sonars.corner_reach, sonars.edge_reach) > 0.0:
        specular = sonars.cos_limit, sonars.sin_limit
        reaches = sonars.corner_reach, sonars.edge_reach
        best, best_tangent = corner_echo(
            seen, count, sonars.slope, specular, reaches, best, best_tangent
        )
    return (best, best_tangent) if best < sonars.max_range else (np.inf, 0.0)


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _shown_point(
    seen: np.ndarray, count: int, j: int, beam: tuple[float, float, float], tangent: float
) -> tuple[float, float]:
    """Range and tangent of a wall's nearest point that echoes and is not hidden.

    `tangent` is that of the nearest point if nothing hid it; infinite where all is hidden.
    """
    ax, ay, bx, by, area = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j], seen[AREA, j]
    low, high = _span(ax, ay, bx, by, beam)
    nx, ny = by - ay, ax - bx
    best, best_tangent = np.inf, 0.0
    for side in (1.0, -1.0):
        end = high if side > 0.0 else low
        shown = _emerge(seen, count, j, tangent, side, end)
        if side * (end - shown) > HAIR:
            reach = area * math.sqrt(1.0 + shown * shown) / (nx + ny * shown)
            if reach < best:
                best, best_tangent = reach, shown
            if shown == tangent:
                break  # nothing hides it, and nothing on the other side is nearer
    return best, best_tangent


@njit(cache=True, error_model="numpy")
def _emerge(
    seen: np.ndarray, count: int, wall: int, tangent: float, side: float, end: float
) -> float:
    """From a tangent on to one side (1 or -1), the first where nothing hides the wall.

    At or beyond `end` where there is none. A gap narrower than HAIR, as between walls
    that touch, is none.
    """
    nx, ny = seen[BY, wall] - seen[AY, wall], seen[AX, wall] - seen[BX, wall]
    area = seen[AREA, wall]
    moved = True
    while moved and side * (end - tangent) > HAIR:
        moved = False
        probe = tangent + side * HAIR
        for j in range(count):
            ax, ay, bx, by = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j]
            if j == wall or ax * probe < ay or by < bx * probe or seen[AREA, j] == 0.0:
                continue
            share = seen[AREA, j] * NEARER
            cx, cy = (by - ay) * area - nx * share, (ax - bx) * area - ny * share
            if cx + cy * probe > 0.0:
                ahead = min(_leave(ax, -ay, side), _leave(-bx, by, side))
                tangent = side * min(ahead, _leave(cy, cx, side))
                moved = True
                break
    return tangent


@njit(cache=True, error_model="numpy")
def _leave(slope: float, offset: float, side: float) -> float:
    """Where, going to one side, slope t + offset >= 0 ends to hold: side times that t."""
    return -side * offset / slope if slope * side < 0.0 else np.inf
