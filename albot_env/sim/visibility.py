"""Which walls matter where: a list for a cell of a grid, never too short.

A wall is left out of a cell's list only where it is out of reach, or where others that
hang together hide all of it from all of the cell. Seen from the cell, what lies beyond a
wall's line and between the two lines that touch the cell and one end of the wall each is in
the wall's shadow: three half-planes, and another wall is hidden where both its ends
lie in all three. Where the next wall of a chain goes on sideways without going beyond
the line, the shadow reaches as far as the chain: each beam towards something beyond
the line meets the chain before.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from albot_core.compiled import kernel

if TYPE_CHECKING:
    from albot_env.sim.wall_index import Walls

_ZERO: Any = np.int64(0)
"""A plain 0 is a type of its own to numba: what it is passed to would be compiled twice."""
_MARGIN = 1e-6
"""How deep (m) in the shadow an end must lie: more than rounding can move it."""


@kernel(arrays=True)
def list_cell(
    index: Walls,
    first: int,
    last: int,
    x: float,
    y: float,
    cell: float,
    reach: tuple[float, float],
) -> None:
    """List the walls of a building that may matter in the cell about (x, y), near to far."""
    half = cell / 2 + reach[1]
    distances = np.empty(last - first)
    for j in range(first, last):
        distances[j - first] = _distance(index.walls[j], x, y)
    screens = np.empty((last - first, 3, 3))
    order = np.empty(last - first, np.int64)
    _sort(distances, order)
    in_use = _ZERO
    for k in order:
        if distances[k] > reach[0] + cell * math.sqrt(0.5):
            break
        j = first + int(k)
        if _hidden(index.walls[j], screens, in_use):
            continue
        index.members[index.used[0]] = j
        index.used[0] += 1
        if _shadow(index.walls, index.neighbours, j, x, y, half, screens[in_use]):
            in_use += 1


@kernel()
def _distance(wall: np.ndarray, x: float, y: float) -> float:
    """Distance from (x, y) to a wall."""
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    along = ((x - wall[0]) * ex + (y - wall[1]) * ey) / (ex * ex + ey * ey)
    along = min(max(along, 0.0), 1.0)
    return math.hypot(wall[0] + along * ex - x, wall[1] + along * ey - y)


@kernel()
def _sort(keys: np.ndarray, order: np.ndarray) -> None:
    """Fill `order` with the places of the keys, ascending (Shell's method).

    numba takes seconds to compile its own sort.
    """
    for k in range(order.shape[0]):
        order[k] = k
    gap = order.shape[0] // 2
    while gap > 0:
        for i in range(gap, order.shape[0]):
            moved, at = order[i], i
            while at >= gap and keys[order[at - gap]] > keys[moved]:
                order[at] = order[at - gap]
                at -= gap
            order[at] = moved
        gap //= 2


@kernel()
def _hidden(wall: np.ndarray, screens: np.ndarray, count: int) -> bool:
    """Whether all of the wall lies in the shadow of one of the first screens."""
    for s in range(count):
        hidden = True
        for h in range(3):
            nx, ny, offset = screens[s, h, 0], screens[s, h, 1], screens[s, h, 2]
            first = nx * wall[0] + ny * wall[1] - offset
            second = nx * wall[2] + ny * wall[3] - offset
            hidden = hidden and first > _MARGIN and second > _MARGIN
        if hidden:
            return True
    return False


@kernel()
def _shadow(
    walls: np.ndarray,
    neighbours: np.ndarray,
    wall: int,
    x: float,
    y: float,
    half: float,
    planes: np.ndarray,
) -> bool:
    """Fill `planes` with the half-planes n · p > offset of a wall's shadow.

    False where the cell about (x, y) does not lie on one side of the wall: no shadow.
    """
    sx, sy, ex, ey = walls[wall, 0], walls[wall, 1], walls[wall, 2], walls[wall, 3]
    left = 0
    if _left_of(sx, sy, ex, ey, x, y) > 0.0:
        sx, sy, ex, ey = ex, ey, sx, sy
        left = 1
    # Now the cell is to the right of the way from s to e: from it, s is the left end.
    _half_plane(ex - sx, ey - sy, sx, sy, planes[0])
    for k in range(4):
        cx, cy = _corner(x, y, half, k)
        if planes[0, 0] * cx + planes[0, 1] * cy - planes[0, 2] > -_MARGIN:
            return False
    lx, ly = _follow(walls, neighbours, 2 * wall + left, 1.0, (ex, ey), planes[0], x, y, half)
    rx, ry = _follow(walls, neighbours, 2 * wall + 1 - left, -1.0, (lx, ly), planes[0], x, y, half)
    # The shadow lies right of the most clockwise of the lines through the left end, and
    # left of the most counter-clockwise of those through the right end.
    _tangent(lx, ly, 1.0, x, y, half, planes[1])
    _tangent(rx, ry, -1.0, x, y, half, planes[2])
    return True


@kernel()
def _follow(
    walls: np.ndarray,
    neighbours: np.ndarray,
    end: int,
    side: float,
    other: tuple[float, float],
    line: np.ndarray,
    x: float,
    y: float,
    half: float,
) -> tuple[float, float]:
    """How far the chain of walls from an end on goes on to one side (1 left, -1 right).

    It must not go beyond the line, nor back, and from every corner of the cell must span
    less than a half turn from the point `other`.
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
            goes_on = goes_on and side * _left_of(cx, cy, px, py, nx, ny) > _MARGIN
            goes_on = goes_on and side * _left_of(cx, cy, other[0], other[1], nx, ny) > _MARGIN
        if not goes_on:
            break
        px, py = nx, ny
    return px, py


@kernel()
def _tangent(
    px: float, py: float, side: float, x: float, y: float, half: float, plane: np.ndarray
) -> None:
    """The half-plane to the right (side 1) or left (-1) of all lines from the cell through p."""
    dx = dy = 0.0
    for k in range(4):
        cx, cy = _corner(x, y, half, k)
        if k == 0 or side * (dx * (py - cy) - dy * (px - cx)) < 0.0:
            dx, dy = px - cx, py - cy
    _half_plane(-side * dx, -side * dy, px, py, plane)


@kernel()
def _corner(x: float, y: float, half: float, k: int) -> tuple[float, float]:
    """Corner k of a cell about (x, y)."""
    return x + half * (2 * (k % 2) - 1), y + half * (2 * (k // 2) - 1)


@kernel()
def _half_plane(dx: float, dy: float, x: float, y: float, plane: np.ndarray) -> None:
    """What lies left of the line through (x, y) in direction (dx, dy), as n · p > offset."""
    length = math.hypot(dx, dy)
    plane[0], plane[1] = -dy / length, dx / length
    plane[2] = plane[0] * x + plane[1] * y


@kernel()
def _left_of(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Positive where p is left of the way from a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)
