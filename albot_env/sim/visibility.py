"""Potentially visible walls: a list per grid cell that contains every wall visible from there.

Such lists are known as potentially visible sets. A cell's list omits a wall only if it is out of
reach, or if every piece of it is hidden from the whole cell by chains of other walls. The shadow
of a wall is the intersection of three half-planes: beyond the wall's line, and between two lines
that touch the cell, one through each end of the wall. If the next wall of a chain continues
sideways without crossing the line, the shadow extends to the end of the chain, because every
beam to a point beyond the line meets the chain first. A wall whose end touches the wall that
hides it counts as hidden: both are equally far there, and either gives the same range.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.segment_kernels import left_of, nearest_on_segment
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.bits import lowest_bit
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.kernels.simd import (
    LANES,
    FloatTable,
    FloatVector,
    first_bits,
    float64_predicate,
    padded_length,
)
from albot_core.kernels.sorting import sort_order
from albot_env.sim.plane_geometry import compose_transforms, transform_of

BLOCK = 8
"""Cells along each side of a block. A cell's list is chosen from its block's list, which is far
shorter than the building's."""
_MARGIN = 1e-6
"""Minimum distance (m) of the cell from a wall's line for the wall to cast a shadow, and
minimum depth (m) beyond the line for a wall to be hidden by it."""
_TOUCH = 1e-9
"""Tolerance (m) by which a wall that starts at the end of another lies in that one's shadow."""

HalfPlane = tuple[float, float, float]
"""The points p with n · p >= offset: n.x, n.y (of length 1), offset (m)."""


class WallTables(NamedTuple):
    """The concatenated walls of many buildings, and their lists, for compiled code."""

    walls: np.ndarray
    """(walls, 4) float64: ends x1, y1, x2, y2 (m)."""
    neighbours: np.ndarray
    """(walls, 2) int64: for either end, an end of another wall at the same point, as twice the
    wall's number plus 0 or 1; -1 if there is none."""
    frames: np.ndarray
    """(buildings, 8) float64: corner x, y of the grid (m), cell size (m), columns and rows; its
    first cell, its first wall, and one past its last wall."""
    spans: np.ndarray
    """(cells, 2) int64: where a cell's list begins and ends in `members`; -1 before the list is
    made. A building's cells are followed by one cell for everywhere outside the grid, and by
    the blocks."""
    members: np.ndarray
    """(room,) int32: wall numbers, list after list."""
    used: np.ndarray
    """(1,) int64: number of entries of `members` in use."""


class IndexParameters(NamedTuple):
    """Parameters that the lists of an index are made with."""

    walls: WallTables
    """The buildings' walls and their lists."""
    reach: float
    """Walls farther away than this are not listed (m)."""
    spread: float
    """Maximum distance of a sensor from the mount, in any direction (m)."""
    mount: tuple[float, float]
    """Position of the mount on the robot, x, y (m)."""


@KernelDispatcher
@kernel()
def locate_and_list(
    rows: np.ndarray,
    arguments: KernelArguments,
    done: int,
    buildings: np.ndarray,
    poses: np.ndarray,
    laser_cells: np.ndarray,
    sonar_cells: np.ndarray,
) -> int:
    """Find the robots' cells, and list the walls of cells that have no list yet.

    Args:
        rows: The robots.
        arguments: An `IndexParameters` for the lasers and one for the sonars; an index
            without buildings is skipped.
        done: Number of `rows` already processed.
        buildings: Building of each robot (n,).
        poses: Pose of each robot (n, 3), in the building's frame (m, rad).
        laser_cells: Filled with each robot's cell (n,) in the lasers' index.
        sonar_cells: Filled with each robot's cell (n,) in the sonars' index.

    Returns:
        Number of `rows` processed; fewer than all if `members` is full.
    """
    laser, sonar = unpack(arguments)
    for k in range(done, rows.shape[0]):
        i = rows[k]
        if laser.walls.frames.shape[0]:
            laser_cells[i] = _list_cell(laser, buildings[i], poses[i])
            if laser_cells[i] < 0:
                return k
        if sonar.walls.frames.shape[0]:
            sonar_cells[i] = _list_cell(sonar, buildings[i], poses[i])
            if sonar_cells[i] < 0:
                return k
    return int(rows.shape[0])


@kernel()
def _list_cell(parameters: IndexParameters, building: int, pose: np.ndarray) -> int:
    """Return the cell of a pose, after listing its walls; -1 if `members` has no room for them."""
    index, (ahead, aside) = parameters.walls, parameters.mount
    left, bottom, size, columns, rows, first_cell, first_wall, end = index.frames[building]
    x, y = pose[0], pose[1]
    if ahead != 0.0 or aside != 0.0:  # Sine and cosine are the most expensive part here.
        x, y, _, _ = compose_transforms(transform_of(pose), (ahead, aside, 1.0, 0.0))
    column, row = math.floor((x - left) / size), math.floor((y - bottom) / size)
    inside = 0 <= column < columns and 0 <= row < rows
    cell = int(first_cell) + int(row * columns + column if inside else rows * columns)
    if index.spans[cell, 0] >= 0:
        return cell
    if index.members.shape[0] - index.used[0] < 2 * (end - first_wall):
        return -1
    if inside:
        start, stop = _list_block(parameters, building, int(column) // BLOCK, int(row) // BLOCK)
        index.spans[cell, 0] = index.used[0]
        x, y = left + size * (column + 0.5), bottom + size * (row + 0.5)
        reach = parameters.reach, parameters.spread
        _list_visible(index, index.members[start:stop], x, y, size, reach)
    else:  # Outside the grid, or without one, every wall is listed.
        index.spans[cell, 0] = index.used[0]
        for j in range(int(first_wall), int(end)):
            index.members[index.used[0]] = j
            index.used[0] += 1
    index.spans[cell, 1] = index.used[0]
    return cell


@kernel()
def _list_block(
    parameters: IndexParameters, building: int, column: int, row: int
) -> tuple[int, int]:
    """Return where a block's list begins and ends in `members`; make the list if it is missing.

    A wall that is hidden from the whole block is hidden from each of its cells.
    """
    index = parameters.walls
    left, bottom, size, columns, rows, first_cell, first_wall, end = index.frames[building]
    blocks_a_row = -(-int(columns) // BLOCK)
    block = int(first_cell) + int(columns) * int(rows) + 1 + row * blocks_a_row + column
    if index.spans[block, 0] < 0:
        index.spans[block, 0] = index.used[0]
        side = BLOCK * size
        x, y = left + side * (column + 0.5), bottom + side * (row + 0.5)
        reach = parameters.reach, parameters.spread
        _list_from_all(index, int(first_wall), int(end), x, y, side, reach)
        index.spans[block, 1] = index.used[0]
    return index.spans[block, 0], index.spans[block, 1]


@kernel(arrays=True)
def _list_from_all(
    index: WallTables,
    first: int,
    last: int,
    x: float,
    y: float,
    cell: float,
    reach: tuple[float, float],
) -> None:
    """Run `_list_visible` with the walls `first` to `last` of a building as candidates."""
    _list_visible(index, np.arange(np.int32(first), np.int32(last)), x, y, cell, reach)


@kernel(arrays=True)
def _list_visible(
    index: WallTables,
    candidates: np.ndarray,
    x: float,
    y: float,
    cell: float,
    reach: tuple[float, float],
) -> None:
    """List the candidates that may be visible in the cell about (x, y), near to far."""
    # The candidates within reach of the cell, near to far.
    half, limit = cell / 2 + reach[1], reach[0] + cell * math.sqrt(0.5)
    near, distances = np.empty(len(candidates), np.int64), np.empty(len(candidates))
    count = 0
    for j in candidates:
        x1, y1, x2, y2 = index.walls[j]
        at_x, at_y = nearest_on_segment(x, y, x1, y1, x2, y2)
        near[count], distances[count] = j, length_of(at_x - x, at_y - y)
        count += distances[count] <= limit
    order = np.empty(count, np.int64)
    sort_order(distances, order)
    # Each wall casts a shadow unless it lies in the shadows of nearer walls.
    shadows = np.empty((9, padded_length(count)))
    in_use = ZERO
    for k in order:
        j = near[k]
        if _is_occluded(index.walls[j], shadows, in_use):
            continue
        index.members[index.used[0]] = j
        index.used[0] += 1
        in_use += _cast_shadow(index.walls, index.neighbours, j, x, y, half, shadows, in_use)


@kernel()
def _is_occluded(wall: np.ndarray, shadows: np.ndarray, count: int) -> bool:
    """Whether each piece of the wall lies in one of the first `count` shadows."""
    done = 0.0
    while done < 1.0:
        x, y = wall[0] + done * (wall[2] - wall[0]), wall[1] + done * (wall[3] - wall[1])
        piece = x, y, wall[0], wall[1], wall[2], wall[3]
        end = done
        for first in range(0, count, LANES):
            shading = _shadows_over(shadows, first, piece) & first_bits(count - first)
            while shading:
                end = max(end, _end_of_shadow(shadows, first + lowest_bit(shading), wall))
                shading &= shading - 1
        if end <= done:
            return False
        done = end
    return True


@float64_predicate
def _shadows_over(
    shadows: FloatTable, x: FloatVector, y: FloatVector, *wall: FloatVector
) -> FloatVector:
    """Return which shadows contain a point of a wall.

    A wall along a shadow's line does not count, because it may belong to the chain that casts it.
    """
    x1, y1, x2, y2 = wall
    beyond = (_depth(shadows, 0, x1, y1) > _MARGIN) | (_depth(shadows, 0, x2, y2) > _MARGIN)
    for plane in range(3):
        beyond &= _depth(shadows, plane, x, y) >= -_TOUCH
    return beyond


def _depth(shadows: FloatTable, plane: int, x: FloatVector, y: FloatVector) -> FloatVector:
    """Return the depth of a point inside a half-plane (m)."""
    nx, ny, offset = (shadows[3 * plane + row] for row in range(3))
    return nx * x + ny * y - offset


@kernel()
def _end_of_shadow(shadows: np.ndarray, s: int, wall: np.ndarray) -> float:
    """Return the share of a wall's length at which it leaves a shadow that it is in."""
    end = 1.0
    for plane in range(0, 9, 3):
        nx, ny, offset = shadows[plane, s], shadows[plane + 1, s], shadows[plane + 2, s] - _TOUCH
        before, after = nx * wall[0] + ny * wall[1], nx * wall[2] + ny * wall[3]
        if after < offset:
            end = min(end, (before - offset) / (before - after))
    return end


@kernel()
def _cast_shadow(
    walls: np.ndarray,
    neighbours: np.ndarray,
    wall: int,
    x: float,
    y: float,
    half: float,
    shadows: np.ndarray,
    column: int,
) -> int:
    """Write a wall's shadow into a column of `shadows`; return 0 if it casts none, else 1.

    A wall casts no shadow unless the whole cell about (x, y) lies on one side of it.
    """
    sx, sy, ex, ey = walls[wall, 0], walls[wall, 1], walls[wall, 2], walls[wall, 3]
    left = 0
    if left_of(sx, sy, ex, ey, x, y) > 0.0:
        sx, sy, ex, ey = ex, ey, sx, sy
        left = 1
    # Now the cell lies right of the line from s to e; seen from the cell, s is the left end.
    line = _half_plane(ex - sx, ey - sy, sx, sy)
    for k in range(4):
        cx, cy = _corner(x, y, half, k)
        if line[0] * cx + line[1] * cy - line[2] > -_MARGIN:
            return 0
    lx, ly = _follow_chain(walls, neighbours, 2 * wall + left, 1.0, (ex, ey), line, x, y, half)
    rx, ry = _follow_chain(walls, neighbours, 2 * wall + 1 - left, -1.0, (lx, ly), line, x, y, half)
    # The shadow lies right of the most clockwise line through the left end, and left of the most
    # counter-clockwise line through the right end.
    sides = line, _tangent(lx, ly, 1.0, x, y, half), _tangent(rx, ry, -1.0, x, y, half)
    for side in range(3):
        for row in range(3):
            shadows[3 * side + row, column] = sides[side][row]
    return 1


@kernel()
def _follow_chain(
    walls: np.ndarray,
    neighbours: np.ndarray,
    end: int,
    side: float,
    other: tuple[float, float],
    line: HalfPlane,
    x: float,
    y: float,
    half: float,
) -> tuple[float, float]:
    """Return how far the chain of walls continues from an end to one side (1 left, -1 right).

    The chain must not cross the line or turn back, and from every corner of the cell it must
    span less than a half turn from the point `other`.
    """
    px, py = walls[end // 2, 2 * (end % 2)], walls[end // 2, 2 * (end % 2) + 1]
    for _ in range(len(walls)):
        end = neighbours[end // 2, end % 2]
        if end < 0:
            break
        end ^= 1  # the neighbour's far end
        nx, ny = walls[end // 2, 2 * (end % 2)], walls[end // 2, 2 * (end % 2) + 1]
        if line[0] * nx + line[1] * ny > line[2]:
            break
        goes_on = True
        for k in range(4):
            cx, cy = _corner(x, y, half, k)
            goes_on = goes_on and side * left_of(cx, cy, px, py, nx, ny) > _MARGIN
            goes_on = goes_on and side * left_of(cx, cy, other[0], other[1], nx, ny) > _MARGIN
        if not goes_on:
            break
        px, py = nx, ny
    return px, py


@kernel()
def _tangent(px: float, py: float, side: float, x: float, y: float, half: float) -> HalfPlane:
    """Return the half-plane right (side 1) or left (-1) of all lines from the cell through p."""
    dx = dy = 0.0
    for k in range(4):
        cx, cy = _corner(x, y, half, k)
        if k == 0 or side * (dx * (py - cy) - dy * (px - cx)) < 0.0:
            dx, dy = px - cx, py - cy
    return _half_plane(-side * dx, -side * dy, px, py)


@kernel()
def _corner(x: float, y: float, half: float, k: int) -> tuple[float, float]:
    """Return corner k of a cell about (x, y)."""
    return x + half * (2 * (k % 2) - 1), y + half * (2 * (k // 2) - 1)


@kernel()
def _half_plane(dx: float, dy: float, x: float, y: float) -> HalfPlane:
    """Return the half-plane left of the line through (x, y) in direction (dx, dy)."""
    length = length_of(dx, dy)
    nx, ny = -dy / length, dx / length
    return nx, ny, nx * x + ny * y
