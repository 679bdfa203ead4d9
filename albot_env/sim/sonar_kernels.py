"""Compiled sonars: the reported ranges of a robot's sonars, with cross-talk, noise and misses.

Surfaces are gathered once per robot, in a table with one column for each: positions relative to
the robot (m), axes parallel to the world's. For each sonar, the relevant surfaces are turned
into the sonar's frame, x along its axis: end a clockwise of end b, and area = a × b. They are
packed into other rows of the table, where they mostly fit into one block of columns.
`sonar_echoes` then finds the nearest echo.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.bits import lowest_bit, popcount
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.kernels.simd import LANES, FloatTable, FloatVector, float64_predicate, padded_length
from albot_env.sim.noise import draw
from albot_env.sim.plane_geometry import Transform, compose_transforms, transform_from
from albot_env.sim.sonar import SonarConstants
from albot_env.sim.sonar_echoes import (
    AREA,
    AX,
    AY,
    BLOCKED,
    BX,
    BY,
    FILLED,
    NEAREST,
    OCCLUSION_MARGIN,
    SQUARED,
    X1,
    X2,
    Y1,
    Y2,
    SonarBuffers,
    find_echoes,
)

_FAR = 1e9
"""Coordinate of the surfaces that pad a block (m); it is out of any sonar's reach."""
SONAR_DRAWS = 1
"""Number of random numbers that each sonar draws per reading."""


@kernel()
def measure_echoes(
    walls: np.ndarray,
    nearby: np.ndarray,
    obstacles: np.ndarray,
    robot: Transform,
    sonars: SonarConstants,
    key: np.uint64,
    counter: int,
    buffers: SonarBuffers,
    echoes: np.ndarray,
) -> None:
    """Fill `echoes` (sonars,) with the ranges (m) that a robot's sonars report.

    Args:
        walls: All walls of the world (n, 4) float64, world frame (m).
        nearby: Indices of the walls that may be in reach (int32).
        obstacles: Surfaces of dynamic obstacles (k, 4) float64, world frame (m).
        robot: Pose of the robot, world frame.
        sonars: The sonars.
        key: Key of the robot's random numbers.
        counter: Counter of the reading's first random number; each sonar draws SONAR_DRAWS.
        buffers: Scratch buffers with room for all of these surfaces.
        echoes: Filled with the ranges; infinite where there is no echo.
    """
    _, _, cos, sin = robot
    count = _gather_surfaces(walls, nearby, obstacles, robot, sonars.behind, buffers.table)
    mounts, heard = sonars.mounts, buffers.echoes
    for s in range(mounts.shape[0]):
        _select_surfaces(buffers, s, count, _sonar_transform(mounts, s, cos, sin), sonars)
    find_echoes(buffers, sonars)
    for s in range(mounts.shape[0]):
        reach = heard[s, 0]
        bits = draw(key, counter + s)
        if np.int64((bits >> np.uint64(26)) & np.uint64(0x1FFFFFF)) < sonars.crosstalk:
            other = s + 1 if (bits >> np.uint64(51)) & np.uint64(1) else s - 1
            if 0 <= other < mounts.shape[0]:
                sonar = _sonar_transform(mounts, s, cos, sin)
                neighbour = _sonar_transform(mounts, other, cos, sin)
                out, tangent = heard[other]
                reach = min(reach, _crosstalk_range(sonar, neighbour, out, tangent))
        echoes[s] = _reported_range(reach, bits, sonars)


@kernel()
def _gather_surfaces(
    walls: np.ndarray,
    nearby: np.ndarray,
    obstacles: np.ndarray,
    robot: Transform,
    behind: float,
    table: np.ndarray,
) -> int:
    """Write the surfaces that may be in a sonar's cone into the table; return their number.

    Surfaces whose ends both have an x below `behind` (m, robot's frame) are omitted.
    """
    count = ZERO
    for j in nearby:
        count += _translate_surface(walls, j, robot, behind, table, count)
    for j in range(obstacles.shape[0]):
        count += _translate_surface(obstacles, j, robot, behind, table, count)
    for k in range(count, padded_length(count)):
        table[X1, k] = table[Y1, k] = table[X2, k] = table[Y2, k] = _FAR
    for first in range(0, count, LANES):
        _measure_distances(table, first, ())
    nearest = np.inf
    for block in range((count - 1) // LANES, -1, -1):
        nearest = min(nearest, table[NEAREST, block * LANES])
        table[NEAREST, block * LANES] = nearest
    return int(count)


@kernel()
def _translate_surface(
    surfaces: np.ndarray, k: int, robot: Transform, behind: float, table: np.ndarray, column: int
) -> int:
    """Write a surface into a column; return 0 if it is behind the robot, else 1."""
    x, y, cos, sin = robot
    x1, y1 = surfaces[k, 0] - x, surfaces[k, 1] - y
    x2, y2 = surfaces[k, 2] - x, surfaces[k, 3] - y
    table[X1, column], table[Y1, column], table[X2, column], table[Y2, column] = x1, y1, x2, y2
    return 1 if max(cos * x1 + sin * y1, cos * x2 + sin * y2) >= behind else 0


@float64_predicate
def _measure_distances(table: FloatTable) -> FloatVector:
    """Write the squared distances from the robot's centre."""
    x1, y1, x2, y2 = (table[row] for row in (X1, Y1, X2, Y2))
    dx, dy = x2 - x1, y2 - y1
    along = -(x1 * dx + y1 * dy) / (dx * dx + dy * dy)
    along = along.maximum(0.0).minimum(1.0)  # NaN if both ends coincide; this makes it 0.
    x, y = x1 + along * dx, y1 + along * dy
    squared = x * x + y * y
    table[SQUARED], table[NEAREST] = squared, squared.reduce_min()
    return along <= 1.0


@kernel()
def _sonar_transform(mounts: np.ndarray, s: int, cos: float, sin: float) -> Transform:
    """Return a sonar's position and direction relative to the robot's centre, in world axes."""
    mount = mounts[s, 0], mounts[s, 1], mounts[s, 2], mounts[s, 3]
    return compose_transforms((0.0, 0.0, cos, sin), mount)


@kernel()
def _select_surfaces(
    buffers: SonarBuffers, s: int, count: int, sonar: Transform, sonars: SonarConstants
) -> None:
    """Pack the relevant surfaces of sonar s, in its frame, after those of sonar s - 1.

    Surfaces behind one that fills the whole cone are irrelevant, so the search is fastest with
    the near ones first.
    """
    table, end = buffers.table, buffers.bounds[s]
    x, y, cos, sin = sonar
    slope, reach = sonars.slope, sonars.max_range
    rim, secant = math.sqrt(x * x + y * y), math.sqrt(1.0 + slope * slope)
    for first in range(0, count, LANES):
        far = reach + rim
        if table[NEAREST, first] > far * far:
            break  # All later surfaces are out of reach, too.
        answers = _turn_into_cone(table, (first, end), (far * far, x, y, cos, sin, slope))
        closing = answers >> LANES
        end += popcount(answers ^ closing << LANES)
        while closing:
            lane = first + lowest_bit(closing)
            reach = min(
                reach, OCCLUSION_MARGIN * secant * table[FILLED, lane] / table[BLOCKED, lane]
            )
            closing &= closing - 1
    buffers.bounds[s + 1] = end


@float64_predicate
def _turn_into_cone(
    table: FloatTable, together: FloatTable, *view: FloatVector
) -> tuple[FloatVector, FloatVector]:
    """Turn surfaces into a sonar's frame and pack those that are in its cone.

    The first mask marks the surfaces in the cone: in reach, with an end ahead of the sonar and an
    end within each side of the cone. The second marks those that fill the cone.
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


@kernel()
def _crosstalk_range(sonar: Transform, neighbour: Transform, out: float, tangent: float) -> float:
    """Return the range (m) at which a sonar hears a neighbour's echo of range `out` (m).

    It is half the path from the neighbour to the echoing point and on to this sonar.
    """
    if out == np.inf:
        return np.inf
    along = out / math.sqrt(1.0 + tangent * tangent)
    x, y = transform_from(neighbour, along, along * tangent)
    return (out + length_of(x - sonar[0], y - sonar[1])) / 2


@kernel()
def _reported_range(reach: float, bits: np.uint64, sonars: SonarConstants) -> float:
    """Return the reported range of an echo: with noise, misses and the range limits applied."""
    if np.int64(bits & np.uint64(0x3FFFFFF)) < sonars.dropout:
        return np.inf
    share = sonars.proportional_noise * reach
    deviation = math.sqrt(sonars.noise * sonars.noise + share * share)
    reach += deviation * sonars.normals[bits >> np.uint64(52)]
    return max(reach, sonars.min_range) if reach < sonars.max_range else np.inf
