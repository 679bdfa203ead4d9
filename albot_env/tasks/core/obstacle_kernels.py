"""Memory of the obstacles that robots saw lately: the obstacle layer of a local costmap.

A costmap's obstacle layer marks where beams end, and clears what beams pass (E. Marder-Eppstein
and others, The office marathon, ICRA 2010). It moves with the robot, in the frame of its odometer:
no correction of the map displaces it, and what is farther back than some metres of travel, whose
position is no longer sure, is forgotten. It keeps surfaces as points, at most one in each cell of a
grid, so that it is drawn and cleared quickly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import (
    compose,
    length_of,
    pseudo_angle,
    rotate_back,
    transform_point,
)
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.coverage_kernels import CoverageSensor, accumulate_motion

CELL = 0.15
"""Side of the cells of which each keeps one point (m)."""
MOST = 4096
"""Number of points that are kept; a further one takes the place of the one seen longest ago."""
_SPACING, _TURN = 0.1, 0.1
"""Readings are drawn each time the robot has moved (m) or turned (rad) so much."""
_MARGIN = 0.2
"""A beam passes a point that is nearer than its end by more than this (m)."""
X, Y, SEEN = range(3)
"""Columns of a point: its position (frame of the odometer, m), and the distance that the robot had
travelled when it was seen last (m)."""


class ObstacleMemory(NamedTuple):
    """The surfaces that robots saw lately (frames of their odometers), one row per robot."""

    length: float
    """A surface is forgotten when the robot has travelled so far since it was seen (m)."""
    reach: float
    """Readings are drawn up to this distance from the laser (m)."""
    side: int
    """Number of cells along each side of the grids. Cells as many apart share a slot: they are
    never remembered at the same time. 0 if nothing is to be remembered."""
    poses: np.ndarray
    """(n, 3) float64: poses, by the odometer alone."""
    travelled: np.ndarray
    """(n,) float64: distance travelled, by the odometer (m)."""
    moved: np.ndarray
    """(n, 2) float64: distance and turning since readings were last drawn (m, rad)."""
    slots: np.ndarray
    """(n, cells) int16: index, from 1, of the point in each cell; 0 for none."""
    counts: np.ndarray
    """(n,) int64: number of points."""
    points: np.ndarray
    """(n, most, 3) float64: the points, in the columns `X`, `Y`, `SEEN`."""


def empty_obstacles(robots: int, length: float, reach: float) -> ObstacleMemory:
    """Return the memory of robots who remember nothing yet; `length` 0 for those who never do."""
    side = math.ceil(2 * (length + reach) / CELL) + 2 if length > 0 else 0
    return ObstacleMemory(
        length=float(length),
        reach=float(reach),
        side=side,
        poses=np.zeros((robots, 3)),
        travelled=np.zeros(robots),
        moved=np.full((robots, 2), np.inf),
        slots=np.zeros((robots, side * side), np.int16),
        counts=np.zeros(robots, np.int64),
        points=np.zeros((robots, MOST if side else 0, 3)),
    )


@kernel(arrays=True)
def forget_obstacles(memory: ObstacleMemory, i: int) -> None:
    """Begin the memory of robot i anew."""
    memory.slots[i, :] = 0
    memory.poses[i, :] = 0.0
    memory.moved[i, :] = math.inf
    memory.travelled[i], memory.counts[i] = 0.0, 0


@kernel(arrays=True)
def recall_obstacles(memory: ObstacleMemory, i: int, points: np.ndarray) -> None:
    """Give robot i, who remembers nothing, these points (any number, 3)."""
    memory.counts[i] = points.shape[0]
    for k in range(points.shape[0]):
        memory.points[i, k] = points[k]
        memory.slots[i, _slot(memory, points[k, X], points[k, Y])] = k + 1


@kernel()
def remember_obstacles(
    memory: ObstacleMemory, i: int, sensor: CoverageSensor, motion: np.ndarray, ranges: np.ndarray
) -> None:
    """Add robot i's motion and reading: clear what beams pass, and mark where they end."""
    x, y, heading = compose(memory.poses[i], motion)
    memory.poses[i, 0], memory.poses[i, 1], memory.poses[i, 2] = x, y, heading
    memory.travelled[i] += length_of(motion[0], motion[1])
    if not accumulate_motion(motion, _SPACING, _TURN, memory.moved[i]):
        return
    cos, sin = math.cos(heading), math.sin(heading)
    eye_x, eye_y = transform_point(memory.poses[i], cos, sin, sensor.x, sensor.y)
    _forget_passed(memory, i, (eye_x, eye_y, cos, sin), sensor, ranges)
    for k in range(ranges.shape[0]):
        if ranges[k] < memory.reach:
            bearing = heading + sensor.first + k * sensor.spacing
            ahead, left = ranges[k] * math.cos(bearing), ranges[k] * math.sin(bearing)
            _mark(memory, i, eye_x + ahead, eye_y + left)


@kernel()
def _forget_passed(
    memory: ObstacleMemory,
    i: int,
    eye: tuple[float, float, float, float],
    sensor: CoverageSensor,
    ranges: np.ndarray,
) -> None:
    """Forget robot i's points that were seen too long ago, or that beams pass now."""
    points, oldest, k = memory.points[i], memory.travelled[i] - memory.length, 0
    while k < memory.counts[i]:
        if points[k, SEEN] < oldest or _is_passed(points[k], eye, memory.reach, sensor, ranges):
            _remove(memory, i, k)  # The last one is at its place now.
        else:
            k += 1


@kernel()
def _is_passed(
    point: np.ndarray,
    eye: tuple[float, float, float, float],
    reach: float,
    sensor: CoverageSensor,
    ranges: np.ndarray,
) -> bool:
    """Return whether the beam towards a point and those beside it all end behind the point.

    One beam alone does not tell: it may give no echo, or graze the surface and end farther on.
    """
    x, y, cos, sin = eye
    u, v = rotate_back(cos, sin, point[X] - x, point[Y] - y)
    away = length_of(u, v)
    if away >= reach:
        return False
    parts = sensor.beams.shape[0]
    beam = sensor.beams[min(int((pseudo_angle(u, v) + 2.0) * 0.25 * parts), parts - 1)]
    if beam < 0:
        return False
    for other in range(max(0, beam - 1), min(ranges.shape[0], beam + 2)):
        if ranges[other] <= away + _MARGIN:
            return False
    return True


@kernel()
def _mark(memory: ObstacleMemory, i: int, x: float, y: float) -> None:
    """Remember that robot i sees a surface at a point."""
    slot = _slot(memory, x, y)
    k = memory.slots[i, slot] - 1
    if k < 0:
        if memory.counts[i] == memory.points.shape[1]:
            _remove(memory, i, int(np.argmin(memory.points[i, :, SEEN])))
        k = memory.counts[i]
        memory.counts[i] += 1
        memory.slots[i, slot] = k + 1
    memory.points[i, k, X], memory.points[i, k, Y] = x, y
    memory.points[i, k, SEEN] = memory.travelled[i]


@kernel()
def _remove(memory: ObstacleMemory, i: int, k: int) -> None:
    """Forget robot i's point k; the last point takes its place."""
    points, last = memory.points[i], memory.counts[i] - 1
    memory.slots[i, _slot(memory, points[k, X], points[k, Y])] = 0
    if k != last:
        for column in range(3):
            points[k, column] = points[last, column]
        memory.slots[i, _slot(memory, points[k, X], points[k, Y])] = k + 1
    memory.counts[i] = last


@kernel()
def _slot(memory: ObstacleMemory, x: float, y: float) -> int:
    """Return the slot of the cell in which a point lies."""
    column, row = math.floor(x / CELL) % memory.side, math.floor(y / CELL) % memory.side
    return row * memory.side + column
