"""Compiled geometry of surfaces as a sonar sees them.

Surfaces are gathered once for a robot, in a table with a column for each, relative to the robot
(m) and turned as the world is. A look into a sonar's cone turns those that matter into its frame,
x along its axis: end a clockwise of end b, and area = a × b. In other rows of the table it puts
them together: mostly they fit into one block of columns then.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.bits import lowest, ones
from albot_core.compiled import kernel
from albot_core.lanes import LANES, Lanes, Table, question, whole_lanes
from albot_env.sim.sonar_arrays import Sonars

Ear = tuple[float, float, float, float]
"""A sonar's x, y (m) from the robot's middle, and the cosine and sine of where it points to;
both turned as the world is."""


class Cone(NamedTuple):
    """The surfaces in a sonar's cone, and room for them."""

    table: np.ndarray
    """(ROWS, whole lanes) float64: all surfaces around the robot, and those in the cone."""
    inside: np.ndarray
    """(1,) int64: how many are in the cone."""


X1, Y1, X2, Y2, DISTANCE, NEAREST, INSIDE, DEPTH = range(8)
"""Rows of the table, of all surfaces around the robot: both ends, relative to its middle, and the
distance from there (m); that of the nearest from the block on; and as a sonar sees them, whether
they are in its cone, and how far it sees into the cone past those that fill it (m)."""
AX, AY, BX, BY, AREA, LOW, HIGH, TANGENT, RANGE = range(8, 17)
"""Rows of the table, of the surfaces in a sonar's cone: ends and area as it sees them; and
between which tangents they would echo, and where they would do so nearest (see `cone_kernels`)."""
ROWS = 17
"""How many they are."""
_FAR = 1e9
"""Where surfaces are put that are none (m)."""
HAIR = 1e-7
"""A gap narrower than this, as a difference of tangents, lets no sound through."""
NEARER = 1.0 + 1e-12
"""A wall hides another where that is this much farther: more than by rounding."""


@kernel(arrays=True)
def make_cone(most: int) -> Cone:
    """Room for so many surfaces around a robot."""
    # What is put together in the last columns spills over.
    return Cone(np.empty((ROWS, whole_lanes(most) + LANES)), np.zeros(1, np.int64))


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
    for k in range(count, whole_lanes(count)):
        table[X1, k] = table[Y1, k] = table[X2, k] = table[Y2, k] = _FAR
    for first in range(0, count, LANES):
        _measure(table, first, ())
    nearest = np.inf
    for block in range((count - 1) // LANES, -1, -1):
        nearest = min(nearest, table[NEAREST, block * LANES])
        table[NEAREST, block * LANES] = nearest
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
    along = -(x1 * dx + y1 * dy) / (dx * dx + dy * dy)
    along = along.most(0.0).least(1.0)  # Where both ends are one point it is NaN, and 0 then.
    x, y = x1 + along * dx, y1 + along * dy
    distance = (x * x + y * y).root()
    table[DISTANCE], table[NEAREST] = distance, distance.minimum()
    return along <= 1.0


@kernel()
def look(cone: Cone, count: int, ear: Ear, sonars: Sonars) -> None:
    """Turn the surfaces that matter in a sonar's cone, and put them together.

    What lies behind a surface that fills all of the cone does not matter, so that it goes
    fastest with the near ones first.
    """
    table = cone.table
    slope, reach = sonars.slope, sonars.max_range
    x, y, cos, sin = ear
    # Normals of the cone's two sides, pointing out of it.
    lx, ly = -sin - slope * cos, cos - slope * sin
    rx, ry = sin - slope * cos, -cos - slope * sin
    sides = lx, ly, lx * x + ly * y, rx, ry, rx * x + ry * y
    back = -cos, -sin, -(cos * x + sin * y)
    rim, secant = math.sqrt(x * x + y * y), math.sqrt(1.0 + slope * slope)
    seen = 0
    for first in range(0, count, LANES):
        if table[NEAREST, first] > reach + rim:
            break  # Nor is anything after it in reach.
        inside = _in_cone(table, first, (reach + rim, *sides, *back))
        if not inside:
            continue
        closing = _turn(table, (first, seen), (x, y, cos, sin, slope, NEARER * secant))
        seen += ones(inside)
        while closing:
            reach = min(reach, table[DEPTH, first + lowest(closing)])
            closing &= closing - 1
    _end(table, seen, (0.0,))
    cone.inside[0] = seen


@question
def _in_cone(table: Table, reach: Lanes, *planes: Lanes) -> Lanes:
    """Which surfaces are in reach, and have an end within each of three half-planes x, y, limit.

    A point p is within where x p.x + y p.y <= limit.
    """
    x1, y1, x2, y2 = (table[row] for row in (X1, Y1, X2, Y2))
    inside = table[DISTANCE] <= reach
    for x, y, limit in (planes[:3], planes[3:6], planes[6:]):
        inside &= (x * x1 + y * y1).least(x * x2 + y * y2) <= limit
    table[INSIDE] = inside.counted()
    return inside


@question
def _end(table: Table, area: Lanes) -> Lanes:
    """Give an area to the next columns; those without are no surfaces."""
    table[AREA] = area
    return area > 0.0


@question
def _turn(table: Table, together: Table, *view: Lanes) -> Lanes:
    """Turn surfaces into a sonar's frame; which of them fill its cone."""
    x, y, cos, sin, slope, secant = view
    x1, y1, x2, y2 = table[X1] - x, table[Y1] - y, table[X2] - x, table[Y2] - y
    ax, ay = cos * x1 + sin * y1, cos * y1 - sin * x1
    bx, by = cos * x2 + sin * y2, cos * y2 - sin * x2
    area = ax * by - ay * bx
    in_order = area >= 0.0
    ax, bx = ax.where(bx, in_order), bx.where(ax, in_order)
    ay, by = ay.where(by, in_order), by.where(ay, in_order)
    inside = table[INSIDE] > 0.5
    for row, lanes in ((AX, ax), (AY, ay), (BX, bx), (BY, by), (AREA, area.size())):
        together[row] = lanes.together(inside)
    nx, ny = by - ay, ax - bx
    least = nx - slope * ny.size()
    table[DEPTH] = secant * area.size() / least
    return (ax * slope + ay <= 0.0) & (by >= bx * slope) & (least > 0.0) & inside
