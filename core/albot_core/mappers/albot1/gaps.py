"""Finding the exits in a view.

An exit is a gap of doorway size, about 1 m (thesis, section 4.1.1). The thesis does not say
how a gap is found in a view; here it is where a wall ends, another begins, and all that is
seen between the two is farther than the straight line from the one to the other. Compiled.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.sight import Sight
from albot_core.matching.lines import length_of
from albot_core.sensing.surfaces import CORNER, OCCLUDING

REACH = 6.0
"""Gaps farther away are not looked at (m): there a beam is 10 cm from the next."""
JAMB = 0.35
"""A surface this short at a gap's side may be the wall's face in the gap (m)."""
WALL = 0.25
"""A wall beside a gap is at least this long (m)…"""
ASLANT = np.radians(30.0)
"""…and turned no more than this from the line across the gap (rad)."""


@kernel()
def beyond(px: float, py: float, qx: float, qy: float, x: float, y: float) -> float:
    """How far a point is to the left of the line from p to q (m)."""
    dx, dy = qx - px, qy - py
    return float((dx * (y - py) - dy * (x - px)) / np.sqrt(dx * dx + dy * dy))


@kernel()
def crosses(line: np.ndarray, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the way from a to b passes a line between its ends."""
    dx, dy = line[2] - line[0], line[3] - line[1]
    before = dx * (ay - line[1]) - dy * (ax - line[0])
    after = dx * (by - line[1]) - dy * (bx - line[0])
    if (before > 0.0) == (after > 0.0):
        return False
    ex, ey = bx - ax, by - ay
    first = ex * (line[1] - ay) - ey * (line[0] - ax)
    second = ex * (line[3] - ay) - ey * (line[2] - ax)
    return bool((first > 0.0) != (second > 0.0))


@kernel()
def _runs_along(surface: np.ndarray, dx: float, dy: float) -> bool:
    """Whether a surface is a wall that runs along the direction (dx, dy)."""
    ux, uy = surface[2] - surface[0], surface[3] - surface[1]
    length = np.sqrt(ux * ux + uy * uy)
    along = abs(ux * dx + uy * dy) / (length * np.sqrt(dx * dx + dy * dy))
    return bool(length >= WALL and along >= np.cos(ASLANT))


@kernel()
def _wall_at(sight: Sight, k: int, side: int) -> int:
    """The wall whose end a gap begins at, past the face that the wall has in the gap."""
    beside = k - 1 if side == 0 else k + 1
    is_corner = 0 <= beside < sight.size[0] and sight.edges[k, side] == CORNER
    return beside if is_corner and length_of(sight.surfaces[k]) < JAMB else k


@kernel()
def _opens(sight: Sight, i: int, j: int) -> bool:
    """Whether there may be a gap between the surfaces i and j: the one hides what is behind."""
    right, left = sight.edges[i, 1] == OCCLUDING, sight.edges[j, 0] == OCCLUDING
    return bool(right or left if j == i + 1 else right and left)


@kernel()
def _is_exit(sight: Sight, i: int, j: int, line: np.ndarray, limits: Limits) -> bool:
    """Whether the gap between the surfaces i and j is an exit; `line` (4,) then runs across."""
    right, left = _wall_at(sight, i, 0), _wall_at(sight, j, 1)
    px, py = sight.surfaces[right, 2], sight.surfaces[right, 3]
    qx, qy = sight.surfaces[left, 0], sight.surfaces[left, 1]
    dx, dy = qx - px, qy - py
    width = np.sqrt(dx * dx + dy * dy)
    if width < limits.exit_least or width > limits.exit_most or px * px + py * py > REACH**2:
        return False
    if beyond(px, py, qx, qy, 0.0, 0.0) < 0.0:
        return False
    for k in range(i + 1, j):
        for end in range(2):
            x, y = sight.surfaces[k, 2 * end], sight.surfaces[k, 2 * end + 1]
            if beyond(px, py, qx, qy, x, y) > -0.05:
                return False
    line[0], line[1], line[2], line[3] = px, py, qx, qy
    walls = sight.surfaces
    return bool(_runs_along(walls[right], dx, dy) and _runs_along(walls[left], dx, dy))


@kernel()
def find_exits(sight: Sight, limits: Limits, lines: np.ndarray) -> int:
    """Write the exits in view into `lines` (n, 4), in the robot's frame; return how many.

    An exit runs from the end of one surface to the beginning of a later one, right to left
    as the robot sees it, so that the robot is to its left.
    """
    found = 0
    for i in range(sight.size[0] - 1):
        # What hides nothing at its end can open only towards the next surface.
        last = sight.size[0] if sight.edges[i, 1] == OCCLUDING else i + 2
        for j in range(i + 1, last):
            if found == lines.shape[0]:
                return found
            if _opens(sight, i, j) and _is_exit(sight, i, j, lines[found], limits):
                found += 1
                break
    return found
