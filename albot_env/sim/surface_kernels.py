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

from albot_core.kernels.bits import lowest_bit, popcount
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.kernels.simd import LANES, FloatTable, FloatVector, float64_predicate, padded_length
from albot_env.sim.plane_kernels import Stance
from albot_env.sim.sonar_arrays import Sonars

Ear = tuple[float, float, float, float]
"""A sonar's x, y (m) from the robot's middle, and the cosine and sine of where it points to;
both turned as the world is."""


class Cones(NamedTuple):
    """The surfaces in the cones of a robot's sonars, and room for them."""

    table: np.ndarray
    """(ROWS, columns) float64: all surfaces around the robot, and those in the cones."""
    bounds: np.ndarray
    """(sonars + 1,) int64: in which column those in each sonar's cone begin; where one's end, the
    next one's begin."""
    echoes: np.ndarray
    """(sonars, 2) float64: each one's nearest echo, as range (m), infinite where there is none, and
    tangent of its bearing."""


X1, Y1, X2, Y2, SQUARED, NEAREST, FILLED, BLOCKED = range(8)
"""Rows of the table, of all surfaces around the robot: both ends, relative to its middle (m), and
the square of the distance from there; that of the nearest from the block on; and, of those that
fill a sonar's cone, the area and by what to divide it for how far they let the sonar see."""
AX, AY, BX, BY, AREA, LOW, HIGH, TANGENT, RANGE = range(8, 17)
"""Rows of the table, of the surfaces in the sonars' cones: ends and area as a sonar sees them; and
between which tangents they would echo, and where they would do so nearest (see `cone_kernels`)."""
ROWS = 17
"""How many they are."""
Span = tuple[int, int]
"""The surfaces in one sonar's cone: their first column, and the one behind their last."""
_FAR = 1e9
"""Where surfaces are put that are none (m)."""
HAIR = 1e-7
"""A gap narrower than this, as a difference of tangents, lets no sound through."""
NEARER = 1.0 + 1e-12
"""A wall hides another where that is this much farther: more than by rounding."""


@kernel(arrays=True)
def make_cones(most: int, sonars: int) -> Cones:
    """Room for so many surfaces around a robot with so many sonars."""
    # What is put together in the last columns spills over.
    columns = max(sonars, 1) * padded_length(most) + LANES
    bounds, echoes = np.zeros(sonars + 1, np.int64), np.empty((sonars, 2))
    return Cones(np.empty((ROWS, columns)), bounds, echoes)


@kernel()
def gather(
    walls: np.ndarray,
    nearby: np.ndarray,
    things: np.ndarray,
    robot: Stance,
    behind: float,
    table: np.ndarray,
) -> int:
    """Write the surfaces that may be in a cone of a robot's sonars into their table; how many.

    Left out is what lies with both ends farther behind the robot than `behind`, told as an x in its
    frame (m).
    """
    count = ZERO
    for j in nearby:
        count += _take(walls, j, robot, behind, table, count)
    for j in range(things.shape[0]):
        count += _take(things, j, robot, behind, table, count)
    for k in range(count, padded_length(count)):
        table[X1, k] = table[Y1, k] = table[X2, k] = table[Y2, k] = _FAR
    for first in range(0, count, LANES):
        _measure(table, first, ())
    nearest = np.inf
    for block in range((count - 1) // LANES, -1, -1):
        nearest = min(nearest, table[NEAREST, block * LANES])
        table[NEAREST, block * LANES] = nearest
    return int(count)


@kernel()
def _take(
    surfaces: np.ndarray,
    k: int,
    robot: Stance,
    behind: float,
    table: np.ndarray,
    column: int,
) -> int:
    """Write a surface into a column; 0 if it is behind."""
    x, y, cos, sin = robot
    x1, y1 = surfaces[k, 0] - x, surfaces[k, 1] - y
    x2, y2 = surfaces[k, 2] - x, surfaces[k, 3] - y
    table[X1, column], table[Y1, column], table[X2, column], table[Y2, column] = x1, y1, x2, y2
    return 1 if max(cos * x1 + sin * y1, cos * x2 + sin * y2) >= behind else 0


@float64_predicate
def _measure(table: FloatTable) -> FloatVector:
    """Write the squares of the distances from the robot's middle."""
    x1, y1, x2, y2 = (table[row] for row in (X1, Y1, X2, Y2))
    dx, dy = x2 - x1, y2 - y1
    along = -(x1 * dx + y1 * dy) / (dx * dx + dy * dy)
    along = along.maximum(0.0).minimum(1.0)  # Where both ends are one point it is NaN, and 0 then.
    x, y = x1 + along * dx, y1 + along * dy
    squared = x * x + y * y
    table[SQUARED], table[NEAREST] = squared, squared.reduce_min()
    return along <= 1.0


@kernel()
def look(cones: Cones, s: int, count: int, ear: Ear, sonars: Sonars) -> None:
    """Turn the surfaces that matter in sonar s's cone, and put them behind those of the one before.

    What lies behind a surface that fills all of the cone does not matter, so that it goes
    fastest with the near ones first.
    """
    table, end = cones.table, cones.bounds[s]
    x, y, cos, sin = ear
    slope, reach = sonars.slope, sonars.max_range
    rim, secant = math.sqrt(x * x + y * y), math.sqrt(1.0 + slope * slope)
    for first in range(0, count, LANES):
        far = reach + rim
        if table[NEAREST, first] > far * far:
            break  # Nor is anything after it in reach.
        answers = _turn(table, (first, end), (far * far, x, y, cos, sin, slope))
        closing = answers >> LANES
        end += popcount(answers ^ closing << LANES)
        while closing:
            lane = first + lowest_bit(closing)
            reach = min(reach, NEARER * secant * table[FILLED, lane] / table[BLOCKED, lane])
            closing &= closing - 1
    cones.bounds[s + 1] = end


@float64_predicate
def _turn(
    table: FloatTable, together: FloatTable, *view: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Turn surfaces into a sonar's frame, and put those together that are in its cone.

    Answered is which these are: which are in reach and have an end ahead of the sonar, one within
    each side of the cone; and which of them fill it.
    """
    far2, x, y, cos, sin, slope = view
    x1, y1, x2, y2 = table[X1] - x, table[Y1] - y, table[X2] - x, table[Y2] - y
    ax, ay = cos * x1 + sin * y1, cos * y1 - sin * x1
    bx, by = cos * x2 + sin * y2, cos * y2 - sin * x2
    area = ax * by - ay * bx
    in_order = area >= 0.0
    ax, bx = ax.where(bx, in_order), bx.where(ax, in_order)
    ay, by = ay.where(by, in_order), by.where(ay, in_order)
    area = area.abs()
    rise, other = slope * ax, slope * bx
    inside = (table[SQUARED] <= far2) & (ax.maximum(bx) >= 0.0)
    inside &= ((ay <= rise) | (by <= other)) & ((ay >= -rise) | (by >= -other))
    for row, lanes in ((AX, ax), (AY, ay), (BX, bx), (BY, by), (AREA, area)):
        together[row] = lanes.compress(inside)
    nx, ny = by - ay, ax - bx
    least = nx - slope * ny.abs()
    table[FILLED], table[BLOCKED] = area, least
    return inside, (ay <= -rise) & (by >= other) & (least > 0.0) & inside
