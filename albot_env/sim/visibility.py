"""Which walls can be seen from where: a list for every cell of a grid, never too short.

A wall is left out of a cell's list only where it is out of reach, or where one other wall
hides all of it from all of the cell. Seen from the cell, the part of the plane that
a screen hides is bounded by the screen and by the two lines that touch the cell and one
end of the screen each: three half-planes, and a wall is hidden where both its ends
lie in all three.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_MARGIN = 1e-6
"""How deep (m) in the shadow an end must lie: more than rounding can move it."""


@njit(cache=True)
def list_visible(
    walls: np.ndarray,
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
            if _shadow(walls[j], x, y, cell / 2, screens[in_use]):
                in_use += 1
    starts[columns * rows] = count
    return count


@njit(cache=True)
def _distance(wall: np.ndarray, x: float, y: float) -> float:
    """Distance from (x, y) to a wall."""
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    along = ((x - wall[0]) * ex + (y - wall[1]) * ey) / (ex * ex + ey * ey)
    along = min(max(along, 0.0), 1.0)
    return math.hypot(wall[0] + along * ex - x, wall[1] + along * ey - y)


@njit(cache=True)
def _hidden(wall: np.ndarray, screens: np.ndarray) -> bool:
    """Whether all of the wall lies in one screen's shadow."""
    for s in range(len(screens)):
        hidden = True
        for h in range(3):
            nx, ny, offset = screens[s, h]
            first = nx * wall[0] + ny * wall[1] - offset
            second = nx * wall[2] + ny * wall[3] - offset
            hidden = hidden and first > _MARGIN and second > _MARGIN
        if hidden:
            return True
    return False


@njit(cache=True)
def _shadow(wall: np.ndarray, x: float, y: float, half: float, planes: np.ndarray) -> bool:
    """Fill `planes` with the half-planes n · p > offset of a wall's shadow.

    False where the cell about (x, y) does not lie on one side of the wall: no shadow.
    """
    sx, sy, ex, ey = wall
    if _left_of(sx, sy, ex, ey, x, y) > 0.0:
        sx, sy, ex, ey = ex, ey, sx, sy
    # Now the cell is to the right of the way from s to e: from it, s is the left end.
    _half_plane(ex - sx, ey - sy, sx, sy, planes[0])
    left_x, left_y = right_x, right_y = 0.0, 0.0
    for k in range(4):
        cx, cy = x + half * (2 * (k % 2) - 1), y + half * (2 * (k // 2) - 1)
        if planes[0, 0] * cx + planes[0, 1] * cy - planes[0, 2] > -_MARGIN:
            return False
        # The shadow lies right of the most clockwise of the lines through s, and left
        # of the most counter-clockwise of those through e.
        if k == 0 or left_x * (sy - cy) - left_y * (sx - cx) < 0.0:
            left_x, left_y = sx - cx, sy - cy
        if k == 0 or right_x * (ey - cy) - right_y * (ex - cx) > 0.0:
            right_x, right_y = ex - cx, ey - cy
    _half_plane(-left_x, -left_y, sx, sy, planes[1])
    _half_plane(right_x, right_y, ex, ey, planes[2])
    return True


@njit(cache=True)
def _half_plane(dx: float, dy: float, x: float, y: float, plane: np.ndarray) -> None:
    """What lies left of the line through (x, y) in direction (dx, dy), as n · p > offset."""
    length = math.hypot(dx, dy)
    plane[0], plane[1] = -dy / length, dx / length
    plane[2] = plane[0] * x + plane[1] * y


@njit(cache=True)
def _left_of(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Positive where p is left of the way from a to b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)
