"""Compiled geometry of surfaces as a sonar sees them.

Surfaces are gathered once for a robot, as rows x1, y1, x2, y2 of an array (4, n) that is
relative to the robot (m) and turned as the world is. Those that reach into a sonar's cone are
then turned into its frame, x along its axis: rows ax, ay, bx, by, area of an array
(5, n) `seen`, end a clockwise of end b, and area = a × b.
"""

from __future__ import annotations

import numpy as np
from numba import njit

Ear = tuple[float, float, float, float]
"""A sonar's x, y (m) from the robot's middle, and the cosine and sine of where it points to;
both turned as the world is."""

AX, AY, BX, BY, AREA = range(5)
"""Rows of `seen`."""
HAIR = 1e-7
"""A gap narrower than this, as a difference of tangents, lets no sound through."""
NEARER = 1.0 + 1e-12
"""A wall hides another where that is this much farther: more than by rounding."""


@njit(cache=True, error_model="numpy")
def gather(
    walls: np.ndarray,
    nearby: np.ndarray,
    things: np.ndarray,
    pose: np.ndarray,
    reach: float,
    ends: np.ndarray,
) -> int:
    """Fill `ends` (4, n) with the surfaces that may be in reach (m) of a robot; how many."""
    count = 0
    for k in nearby:
        count += _take(walls, k, pose, reach, ends, count)
    for k in range(things.shape[0]):
        count += _take(things, k, pose, reach, ends, count)
    return count


@njit(cache=True, error_model="numpy")
def _take(
    surfaces: np.ndarray,
    k: int,
    pose: np.ndarray,
    reach: float,
    ends: np.ndarray,
    count: int,
) -> int:
    """Write a surface into column `count`; 1 if it is worth keeping, 0 if surely out of reach."""
    x1, y1 = surfaces[k, 0] - pose[0], surfaces[k, 1] - pose[1]
    x2, y2 = surfaces[k, 2] - pose[0], surfaces[k, 3] - pose[1]
    ends[0, count], ends[1, count], ends[2, count], ends[3, count] = x1, y1, x2, y2
    if min(x1, x2) > reach or max(x1, x2) < -reach or min(y1, y2) > reach:
        return 0
    return 0 if max(y1, y2) < -reach else 1


@njit(cache=True, error_model="numpy")
def look(
    ends: np.ndarray,
    count: int,
    ear: Ear,
    slope: float,
    reach: float,
    inside: np.ndarray,
    seen: np.ndarray,
) -> int:
    """Fill `seen` with the surfaces that reach into a sonar's cone; how many.

    `slope` is the tangent of half the cone, `inside` (n,) is written over.
    """
    x, y, cos, sin = ear
    # Normals of the cone's two sides, pointing out of it, and of its far end.
    lx, ly = -sin - slope * cos, cos - slope * sin
    rx, ry = sin - slope * cos, -cos - slope * sin
    left, right, far = lx * x + ly * y, rx * x + ry * y, cos * x + sin * y + reach
    for k in range(count):
        x1, y1, x2, y2 = ends[0, k], ends[1, k], ends[2, k], ends[3, k]
        beyond = min(lx * x1 + ly * y1, lx * x2 + ly * y2) - left
        beyond = max(beyond, min(rx * x1 + ry * y1, rx * x2 + ry * y2) - right)
        inside[k] = max(beyond, min(cos * x1 + sin * y1, cos * x2 + sin * y2) - far)
    found = 0
    for k in range(count):
        if inside[k] <= 0.0:
            _turn(ends, k, ear, seen, found)
            found += 1
    return found


@njit(cache=True, error_model="numpy")
def _turn(ends: np.ndarray, k: int, ear: Ear, seen: np.ndarray, column: int) -> None:
    """Write a surface in the sonar's frame into a column of `seen`."""
    x, y, cos, sin = ear
    x1, y1, x2, y2 = ends[0, k] - x, ends[1, k] - y, ends[2, k] - x, ends[3, k] - y
    ax, ay = cos * x1 + sin * y1, cos * y1 - sin * x1
    bx, by = cos * x2 + sin * y2, cos * y2 - sin * x2
    area = ax * by - ay * bx
    if area < 0.0:
        ax, ay, bx, by = bx, by, ax, ay
    seen[AX, column], seen[AY, column] = ax, ay
    seen[BX, column], seen[BY, column] = bx, by
    seen[AREA, column] = abs(area)


@njit(cache=True, error_model="numpy")
def bounded(low: float, high: float, slope: float, offset: float) -> tuple[float, float]:
    """The part of an interval of t in which slope t + offset >= 0."""
    if slope > 0.0:
        return max(low, -offset / slope), high
    if slope < 0.0:
        return low, min(high, -offset / slope)
    return (low, high) if offset >= 0.0 else (np.inf, -np.inf)
