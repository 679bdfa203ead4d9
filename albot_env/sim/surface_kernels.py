"""Compiled geometry of surfaces as a sonar sees them.

Surfaces are gathered once for a robot, in a table with a column for each, relative to the robot
(m) and turned as the world is. A look into a sonar's cone turns those that matter into its frame,
x along its axis: end a clockwise of end b, and area = a × b. They stay where they are in the
table; which blocks of columns have any, and which, is noted beside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.compiled import kernel
from albot_env.sim.lanes import LANES, Lanes, Table, first_of, lowest, question, whole_lanes
from albot_env.sim.sonar_arrays import Sonars

Ear = tuple[float, float, float, float]
"""A sonar's x, y (m) from the robot's middle, and the cosine and sine of where it points to;
both turned as the world is."""


class Cone(NamedTuple):
    """The surfaces in a sonar's cone, and room for them."""

    table: np.ndarray
    """(ROWS, whole lanes) float64: all surfaces around the robot."""
    blocks: np.ndarray
    """(2, blocks) int64: of each block that has any in the cone, its first column, and a bit
    for each of its columns that is."""
    noted: np.ndarray
    """(1,) int64: how many such blocks there are."""


X1, Y1, X2, Y2, DISTANCE, AX, AY, BX, BY, AREA, DEPTH = range(11)
"""Rows of the table: both ends of a surface and its distance from the robot's middle; its ends
and area seen from the sonar, and how far one sees into the cone past it."""
ROWS = 11
"""How many they are."""
FIRST, INSIDE = 0, 1
"""Rows of `Cone.blocks`."""
HAIR = 1e-7
"""A gap narrower than this, as a difference of tangents, lets no sound through."""
NEARER = 1.0 + 1e-12
"""A wall hides another where that is this much farther: more than by rounding."""


@kernel(arrays=True)
def make_cone(most: int) -> Cone:
    """Room for so many surfaces around a robot."""
    columns = whole_lanes(most)
    blocks = np.empty((2, columns // LANES), np.int64)
    return Cone(np.empty((ROWS, columns)), blocks, np.zeros(1, np.int64))


@kernel()
def gather(
    walls: np.ndarray, nearby: np.ndarray, things: np.ndarray, pose: np.ndarray, table: np.ndarray
) -> int:
    """Write the surfaces that may be in reach of a robot into a cone's table; how many."""
    near = int(nearby.shape[0])
    count = near + int(things.shape[0])
    for k in range(near):
        _take(walls, nearby[k], pose, table, k)
    for k in range(near, count):
        _take(things, k - near, pose, table, k)
    for first in range(0, count, LANES):
        _measure(table, first, ())
    return count


@kernel()
def _take(surfaces: np.ndarray, k: int, pose: np.ndarray, table: np.ndarray, column: int) -> None:
    table[X1, column] = surfaces[k, 0] - pose[0]
    table[Y1, column] = surfaces[k, 1] - pose[1]
    table[X2, column] = surfaces[k, 2] - pose[0]
    table[Y2, column] = surfaces[k, 3] - pose[1]


@question
def _measure(table: Table) -> Lanes:
    """Write the distances from the robot's middle."""
    x1, y1, x2, y2 = (table[row] for row in (X1, Y1, X2, Y2))
    dx, dy = x2 - x1, y2 - y1
    zero = x1 * 0.0
    along = (zero - (x1 * dx + y1 * dy)) / (dx * dx + dy * dy)
    along = along.where(zero, along > 0.0)  # Where both ends are one point it is NaN.
    along = along.where(zero + 1.0, along < 1.0)
    x, y = x1 + along * dx, y1 + along * dy
    table[DISTANCE] = (x * x + y * y).root()
    return along <= 1.0


@kernel()
def look(cone: Cone, count: int, ear: Ear, sonars: Sonars) -> None:
    """Turn the surfaces that matter in a sonar's cone, and note them.

    What lies behind a surface that fills all of the cone does not matter, so that it goes
    fastest with the near ones first.
    """
    table, blocks = cone.table, cone.blocks
    slope, reach = sonars.slope, sonars.max_range
    x, y, cos, sin = ear
    # Normals of the cone's two sides, pointing out of it.
    lx, ly = -sin - slope * cos, cos - slope * sin
    rx, ry = sin - slope * cos, -cos - slope * sin
    sides = lx, ly, lx * x + ly * y, rx, ry, rx * x + ry * y
    back = -cos, -sin, -(cos * x + sin * y)
    rim, secant = math.sqrt(x * x + y * y), math.sqrt(1.0 + slope * slope)
    noted = 0
    for first in range(0, count, LANES):
        inside = _in_cone(table, first, (reach + rim, *sides, *back)) & first_of(count - first)
        if not inside:
            continue
        closing = _turn(table, first, (x, y, cos, sin, slope, NEARER * secant)) & inside
        blocks[FIRST, noted], blocks[INSIDE, noted] = first, inside
        noted += 1
        while closing:
            reach = min(reach, table[DEPTH, first + lowest(closing)])
            closing &= closing - 1
    cone.noted[0] = noted


@question
def _in_cone(table: Table, reach: Lanes, *planes: Lanes) -> Lanes:
    """Which surfaces are in reach, and have an end within each of three half-planes x, y, limit.

    A point p is within where x p.x + y p.y <= limit.
    """
    x1, y1, x2, y2 = (table[row] for row in (X1, Y1, X2, Y2))
    inside = table[DISTANCE] <= reach
    for x, y, limit in (planes[:3], planes[3:6], planes[6:]):
        inside &= (x * x1 + y * y1).least(x * x2 + y * y2) <= limit
    return inside


@question
def _turn(table: Table, *view: Lanes) -> Lanes:
    """Turn surfaces into a sonar's frame; which of them fill its cone."""
    x, y, cos, sin, slope, secant = view
    x1, y1, x2, y2 = table[X1] - x, table[Y1] - y, table[X2] - x, table[Y2] - y
    ax, ay = cos * x1 + sin * y1, cos * y1 - sin * x1
    bx, by = cos * x2 + sin * y2, cos * y2 - sin * x2
    area = ax * by - ay * bx
    in_order = area >= 0.0
    ax, bx = ax.where(bx, in_order), bx.where(ax, in_order)
    ay, by = ay.where(by, in_order), by.where(ay, in_order)
    table[AX], table[AY], table[BX], table[BY], table[AREA] = ax, ay, bx, by, area.size()
    nx, ny = by - ay, ax - bx
    least = nx - slope * ny.size()
    table[DEPTH] = secant * area.size() / least
    return (ax * slope + ay <= 0.0) & (by >= bx * slope) & (least > 0.0)


@kernel()
def bounded(low: float, high: float, slope: float, offset: float) -> tuple[float, float]:
    """The part of an interval of t in which slope t + offset >= 0.

    Nothing branches here: which way it goes cannot be foreseen.
    """
    bound = -offset / slope
    low = max(low, bound if slope > 0.0 else -np.inf)
    high = min(high, bound if slope < 0.0 else np.inf)
    return low, (-np.inf if slope == 0.0 and offset < 0.0 else high)
