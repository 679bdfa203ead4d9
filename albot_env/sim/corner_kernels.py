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
from numba import njit

from albot_core.geometry.directions import turned
from albot_env.sim.surface_kernels import AREA, AX, AY, BX, BY

_BEYOND = 1.0 + 1e-9
"""A wall is between when the point is this much farther, so not one that touches it."""
_TOUCH = 1e-6
"""A wall that passes a point no farther than this (m) touches it."""


@njit(cache=True, error_model="numpy")
def corner_echo(
    seen: np.ndarray,
    count: int,
    slope: float,
    specular: tuple[float, float],
    reaches: tuple[float, float],
    best: float,
    best_tangent: float,
) -> tuple[float, float]:
    """Range (m) and tangent of the nearest corner or edge that echoes, or else the best so far.

    Args:
        seen: The surfaces in the cone, in the sonar's frame (5, n).
        count: How many there are.
        slope: Tangent of half the cone.
        specular: Cosine and sine of the specular limit.
        reaches: Distances (m) up to which corners and edges echo.
        best: Range (m) of the nearest echo so far.
        best_tangent: Tangent of its bearing.
    """
    farthest = max(reaches[0], reaches[1])
    for j in range(count):
        for end in range(2):
            x, y = seen[2 * end, j], seen[2 * end + 1, j]
            bound = min(best, farthest)
            if x <= 0.0 or abs(y) > slope * x or x * x + y * y >= bound * bound:
                continue
            if _hidden(seen, count, x, y):
                continue
            distance = math.sqrt(x * x + y * y)
            across, along = _opening(seen, count, j, x, y)
            if distance < _reach_of(across, along, specular, reaches):
                best, best_tangent = distance, y / x
    return best, best_tangent


@njit(cache=True, error_model="numpy")
def _reach_of(
    across: float, along: float, specular: tuple[float, float], reaches: tuple[float, float]
) -> float:
    """From how far (m) a point is heard, by the sine and cosine of its opening, times an area."""
    if along < 0.0 and abs(across) <= -_TOUCH * along:
        return 0.0  # a straight wall
    if across > 0.0:
        return reaches[0] if abs(along) * specular[0] <= across * specular[1] else 0.0
    return reaches[1] if across < 0.0 or along > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _opening(seen: np.ndarray, count: int, wall: int, x: float, y: float) -> tuple[float, float]:
    """The angle, on the sonar's side, between the walls that touch a wall's end (x, y).

    Told by its sine and cosine, times the lengths of both (m²). A full turn at the end of a
    single wall; both 0 where a wall before it ends there too, with which the point was looked at.
    """
    # The next walls counter-clockwise and clockwise of the line to the sonar.
    left, left_x, left_y = np.inf, 0.0, 0.0
    right, right_x, right_y = -np.inf, 0.0, 0.0
    for j in range(count):
        ax, ay, bx, by = seen[AX, j] - x, seen[AY, j] - y, seen[BX, j] - x, seen[BY, j] - y
        if not _touches(ax, ay, bx, by):
            continue
        for end in range(2):
            px, py = (ax, ay) if end == 0 else (bx, by)
            if j < wall and px == 0.0 and py == 0.0:
                return 0.0, 0.0
            if px * px + py * py > _TOUCH * _TOUCH:
                # From 0 to 4, counter-clockwise from the direction to the sonar, (-x, -y).
                turn = 2.0 + turned(x * px + y * py, x * py - y * px)
                if turn < left:
                    left, left_x, left_y = turn, px, py
                if turn > right:
                    right, right_x, right_y = turn, px, py
    return right_x * left_y - right_y * left_x, right_x * left_x + right_y * left_y


@njit(cache=True, error_model="numpy")
def _touches(ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the wall from a to b passes the origin no farther than _TOUCH (m)."""
    if min(ax, bx) > _TOUCH or max(ax, bx) < -_TOUCH or min(ay, by) > _TOUCH:
        return False
    if max(ay, by) < -_TOUCH:
        return False
    across = ax * by - ay * bx
    return across * across <= _TOUCH * _TOUCH * ((bx - ax) ** 2 + (by - ay) ** 2)


@njit(cache=True, error_model="numpy")
def _hidden(seen: np.ndarray, count: int, x: float, y: float) -> bool:
    """Whether a wall stands between the sonar and the point (x, y)."""
    for j in range(count):
        ax, ay, bx, by = seen[AX, j], seen[AY, j], seen[BX, j], seen[BY, j]
        area = seen[AREA, j]
        if ax * y < ay * x or by * x < bx * y or area == 0.0:
            continue
        if ((by - ay) * x + (ax - bx) * y) > area * _BEYOND:
            return True
    return False
