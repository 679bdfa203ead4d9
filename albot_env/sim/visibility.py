"""Which walls can be seen from where: a list for every cell of a grid, never too short.

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

import numpy as np
from numba import njit

_MARGIN = 1e-6
"""How deep (m) in the shadow an end must lie: more than rounding can move it."""


@njit(cache=True, error_model="numpy")
def list_visible(
    walls: np.ndarray,
    neighbours: np.ndarray,
    corner: np.ndarray,
    cell: float,
    shape: tuple[int, int],
    reach: float,
    starts: np.ndarray,
    members: np.ndarray,
) -> int:
    """List the walls that may be seen from each cell of a grid.

    Args:
        walls: Ends x1, y1, x2, y2 (n, 4) of the walls (m).
        neighbours: For either end of each wall (n, 2), another end that stands at the same
            point, as twice its wall's number plus 0 or 1; -1 where there is none.
        corner: Lower left corner x, y of the grid (m).
        cell: Side of a cell (m).
        shape: Columns and rows; cells are numbered row by row.
        reach: Walls farther away (m) are not seen.
        starts: Filled with where each cell's list begins, and behind the last cell with
            where its list ends (cells + 1).
        members: Filled with the walls' numbers, list after list.

    Returns:
        How many members there are. Those for which `members` is too short are not written.
    """
    columns, rows = shape
    count = 0
    screens = np.empty((len(walls), 3, 3))
    distances = np.empty(len(walls))
    for c in range(columns * rows):
        x = corner[0] + cell * (c % columns + 0.5)
        y = corner[1] + cell * (c // columns + 0.5)
        for j in range(len(walls)):
            distances[j] = _distance(walls[j], x, y)
        starts[c] = count
        in_use = 0
        for j in np.argsort(distances):
            if distances[j] > reach + cell * math.sqrt(0.5):
                break
            if _hidden(walls[j], screens[:in_use]):
                continue
            if count < len(members):
                members[count] = j
            count += 1
            if _shadow(walls, neighbours, j, x, y, cell / 2, screens[in_use]):
                in_use += 1
    starts[columns * rows] = count
    return count


@njit(cache=True, error_model="numpy")
def _distance(wall: np.ndarray, x: float, y: float) -> float:
    """Distance from (x, y) to a wall."""
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    along = ((x - wall[0]) * ex + (y - wall[1]) * ey) / (ex * ex + ey * ey)
    along = min(max(along, 0.0), 1.0)
    return math.hypot(wall[0] + along * ex - x, wall[1] + along * ey - y)


@njit(cache=True, error_model="numpy")
def _hidden(wall: np.ndarray, screens: np.ndarray) -> bool:
    """Whether all of the wall lies in one screen's shadow."""
    for s in range(len(screens)):
        hidden = True
        for h in range(3):
            nx, ny, offset = screens[s, h, 0], screens[s, h, 1], screens[s, h, 2]
            first = nx * wall[0] + ny * wall[1] - offset
            second = nx * wall[2] + ny * wall[3] - offset
            hidden = hidden and first > _MARGIN and second > _MARGIN
        if hidden:
            return True
    return False


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _corner(x: float, y: float, half: float, k: int) -> tuple[float, float]:
    """Corner k of a cell about (x, y)."""
    return x + half * (2 * (k % 2) - 1), y + half * (2 * (k // 2) - 1)


@njit(cache=True, error_model="numpy")
def _half_plane(dx: float, dy: float, x: float, y: float, plane: np.ndarray) -> None:
    """What lies left of the line through (x, y) in direction (dx, dy), as n · p > offset."""
    length = math.hypot(dx, dy)
    plane[0], plane[1] = -dy / length, dx / length
    plane[2] = plane[0] * x + plane[1] * y


@njit(cache=True, error_model="numpy")
def _left_of(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Positive where p is left of the way from a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)
