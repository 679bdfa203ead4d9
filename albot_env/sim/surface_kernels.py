"""Compiled geometry of surfaces as a sonar sees them.

Surfaces are gathered once for a robot, as rows x1, y1, x2, y2, distance of an array (5, n)
that is relative to the robot (m) and turned as the world is. Those that matter in a sonar's
cone are then turned into its frame, x along its axis: rows ax, ay, bx, by, area of an array
(5, n) `seen`, end a clockwise of end b, and area = a × b.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from albot_env.sim.lane_calls import LANES, lanes_within, lowest_lane
from albot_env.sim.sonar_arrays import Sonars

Ear = tuple[float, float, float, float]
"""A sonar's x, y (m) from the robot's middle, and the cosine and sine of where it points to;
both turned as the world is."""

DISTANCE = 4
"""Row of the gathered surfaces: distance from the robot's middle (m)."""
AX, AY, BX, BY, AREA = range(5)
"""Rows of `seen`."""
HAIR = 1e-7
"""A gap narrower than this, as a difference of tangents, lets no sound through."""
NEARER = 1.0 + 1e-12
"""A wall hides another where that is this much farther: more than by rounding."""
_BITS, _ALL = 64, np.uint64(2**64 - 1)
"""A word's bits, and a word with all of them."""


@njit(cache=True, error_model="numpy")
def gather(
    walls: np.ndarray,
    nearby: np.ndarray,
    things: np.ndarray,
    pose: np.ndarray,
    reach: float,
    ends: np.ndarray,
) -> int:
    """Fill `ends` (5, n) with the surfaces that may be in reach (m) of a robot; how many.

    Its rows are as long as `lane_calls.whole_lanes` says.
    """
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
    """Write a surface into column `count`; 1 if it is worth keeping, 0 if out of reach."""
    x1, y1 = surfaces[k, 0] - pose[0], surfaces[k, 1] - pose[1]
    x2, y2 = surfaces[k, 2] - pose[0], surfaces[k, 3] - pose[1]
    dx, dy = x2 - x1, y2 - y1
    along = -(x1 * dx + y1 * dy) / (dx * dx + dy * dy)
    along = min(max(along, 0.0), 1.0) if along == along else 0.0
    x, y = x1 + along * dx, y1 + along * dy
    distance = math.sqrt(x * x + y * y)
    ends[0, count], ends[1, count], ends[2, count], ends[3, count] = x1, y1, x2, y2
    ends[DISTANCE, count] = distance
    return 1 if distance <= reach else 0


@njit(cache=True, error_model="numpy")
def look(ends: np.ndarray, count: int, ear: Ear, sonars: Sonars, seen: np.ndarray) -> int:
    """Fill `seen` with the surfaces that matter in a sonar's cone; how many.

    What lies behind a surface that fills all of the cone does not matter, so that it goes
    fastest with the near ones first.
    """
    slope, reach = sonars.slope, sonars.max_range
    x, y, cos, sin = ear
    # Normals of the cone's two sides, pointing out of it.
    lx, ly = -sin - slope * cos, cos - slope * sin
    rx, ry = sin - slope * cos, -cos - slope * sin
    left, right, back = lx * x + ly * y, rx * x + ry * y, cos * x + sin * y
    found, rim = 0, math.sqrt(x * x + y * y)
    for first in range(0, count, _BITS):
        last = min(first + _BITS, count)
        inside = np.int64(0)
        for k in range(first, last, LANES):
            some = lanes_within(ends, k, lx, ly, left, rx, ry, right, -cos, -sin, -back)
            inside |= some << (k - first)
        inside &= np.int64(_ALL >> np.uint64(_BITS - (last - first)))
        while inside:
            k = first + lowest_lane(inside)
            inside &= inside - 1
            if ends[DISTANCE, k] <= reach + rim:
                _turn(ends, k, ear, seen, found)
                reach = min(reach, _closed_off(seen, found, slope))
                found += 1
    return found


@njit(cache=True, error_model="numpy")
def _closed_off(seen: np.ndarray, k: int, slope: float) -> float:
    """How far (m) one can see into a cone past a surface; infinite where it does not fill it."""
    ax, ay, bx, by = seen[AX, k], seen[AY, k], seen[BX, k], seen[BY, k]
    fills = (ax * -slope >= ay) & (by >= bx * slope)
    nx, ny = by - ay, ax - bx
    least = nx - slope * abs(ny)
    depth = NEARER * seen[AREA, k] * math.sqrt(1.0 + slope * slope) / least
    return depth if fills & (least > 0.0) else np.inf


@njit(cache=True, error_model="numpy")
def _turn(ends: np.ndarray, k: int, ear: Ear, seen: np.ndarray, column: int) -> None:
    """Write a surface in the sonar's frame into a column of `seen`."""
    x, y, cos, sin = ear
    x1, y1, x2, y2 = ends[0, k] - x, ends[1, k] - y, ends[2, k] - x, ends[3, k] - y
    ax, ay = cos * x1 + sin * y1, cos * y1 - sin * x1
    bx, by = cos * x2 + sin * y2, cos * y2 - sin * x2
    area = ax * by - ay * bx
    # Nothing branches here: which way it goes cannot be foreseen.
    flip = area < 0.0
    seen[AX, column], seen[AY, column] = (bx if flip else ax), (by if flip else ay)
    seen[BX, column], seen[BY, column] = (ax if flip else bx), (ay if flip else by)
    seen[AREA, column] = abs(area)


@njit(cache=True, error_model="numpy")
def bounded(low: float, high: float, slope: float, offset: float) -> tuple[float, float]:
    """The part of an interval of t in which slope t + offset >= 0.

    Nothing branches here: which way it goes cannot be foreseen.
    """
    bound = -offset / slope
    low = max(low, bound if slope > 0.0 else -np.inf)
    high = min(high, bound if slope < 0.0 else np.inf)
    return low, (-np.inf if slope == 0.0 and offset < 0.0 else high)
