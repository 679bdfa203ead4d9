"""Compiled loops over the ground: covering it, cutting patches, finding its frontier.

A grid of ground is a square of cells, a bit each. Eight by eight cells share a word, so that
what lies around a robot lies together in memory: column x, row y is bit 8 (y % 8) + x % 8 of
word (x // 8) + words a row × (y // 8).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.bits import lowest
from albot_core.compiled import kernel
from albot_core.geometry.directions import turned

_ONE = 2.0**32
"""A cell in fixed-point numbers, in which loops over cells need no conversions: a negative
cell, taken as unsigned, is beyond every grid."""
_WHOLE, _BLOCK = np.uint64(32), np.uint64(35)
"""By how many bits such a number is shifted to get the whole cell, and the block of eight."""
_SIGNS = np.array((-1.0, 1.0), np.float32)
"""What is shown of cells that are not covered, and that are."""


class Ground(NamedTuple):
    """The grids of ground of robots; a row each. Ground beyond a robot's grid is never covered."""

    grids: np.ndarray
    """(n, words) uint64: a bit for each cell, set where covered."""
    sides: np.ndarray
    """(n,) int64: cells along each side; a multiple of eight."""
    centres: np.ndarray
    """(n, 2) float64: the middles of the grids (m)."""
    cell: float
    """Side of a cell (m)."""


class Sight(NamedTuple):
    """What of the ground a laser shows."""

    radius: float
    """Ground farther from the laser is not covered (m)."""
    x: float
    """Where on the robot the laser is (m)…"""
    y: float
    """…"""
    first: float
    """Where its first beam points from the robot's heading (rad)…"""
    spacing: float
    """…and how far it is from each beam to the next (rad)."""
    beams: np.ndarray
    """(parts,) int64: the beam that points into each part of the full turn (see `turned`);
    -1 where none does."""
    ahead: float
    """No beam points to where the cosine of the bearing from the robot's heading is less."""


@kernel()
def is_time_to_look(motion: np.ndarray, spacing: float, turn: float, moved: np.ndarray) -> bool:
    """Add a motion to what was `moved` (m, rad) since the last look; whether one is due."""
    moved[0] += math.hypot(motion[0], motion[1])
    moved[1] += abs(motion[2])
    if moved[0] < spacing and moved[1] < turn:
        return False
    moved[0] = moved[1] = 0.0
    return True


@kernel()
def cover(ground: Ground, i: int, pose: np.ndarray, sight: Sight, ranges: np.ndarray) -> int:
    """Mark the cells of robot i whose middles a scan taken at `pose` shows.

    A middle is seen where it is no farther than the radius, and than the range of the beam
    that points its way. Cells outside the grid are left out. Returns how many were new.
    """
    side, cell, centre = ground.sides[i], ground.cell, ground.centres[i]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    # The laser's place, in cells from the middle of cell (0, 0).
    eye_x = (pose[0] + cos * sight.x - sin * sight.y - centre[0]) / cell + side / 2 - 0.5
    eye_y = (pose[1] + sin * sight.x + cos * sight.y - centre[1]) / cell + side / 2 - 0.5
    eye = eye_x, eye_y, cos, sin
    radius, per_cos = sight.radius / cell, 1.0 / cos
    least = radius * min(sight.ahead, 0.0)
    new = 0
    for row in range(max(0, math.ceil(eye_y - radius)), min(side, math.floor(eye_y + radius) + 1)):
        dy = row - eye_y
        half = math.sqrt(max(0.0, radius * radius - dy * dy))
        # Where on the row something is at least so far ahead.
        bound = (least - sin * dy) * per_cos
        left = max(-half, bound) if cos > 0.0 else -half
        right = min(half, bound) if cos < 0.0 else half
        first = max(0, math.ceil(eye_x + left))
        last = min(side - 1, math.floor(eye_x + right))
        new += _cover_row(ground, i, row, (first, last), eye, sight, ranges)
    return new


@kernel()
def _cover_row(
    ground: Ground,
    i: int,
    row: int,
    columns: tuple[int, int],
    eye: tuple[float, float, float, float],
    sight: Sight,
    ranges: np.ndarray,
) -> int:
    """Mark those cells of a row from the first to the last column that are seen.

    `eye` is the laser's place (cells), and the cosine and sine of the robot's heading. Only cells
    that are not covered yet are looked at: by now most are.
    """
    grid, words, beams = ground.grids[i], ground.sides[i] // 8, sight.beams
    x, y, cos, sin = eye
    parts, per_cell, dy = beams.shape[0], 1.0 / ground.cell, row - y
    first, last = columns
    line, new = (row & 7) << 3, 0
    while first <= last:
        word = (row >> 3) * words + (first >> 3)
        count = min(8 - (first & 7), last - first + 1)
        rest = ~np.int64(grid[word]) >> (line | (first & 7))
        open_ground = int(rest & ((1 << count) - 1))
        while open_ground:
            column = first + lowest(open_ground)
            open_ground &= open_ground - 1
            dx = column - x
            u, v = cos * dx + sin * dy, cos * dy - sin * dx
            beam = beams[min(int((turned(u, v) + 2.0) * 0.25 * parts), parts - 1)]
            if beam < 0:
                continue
            reach = ranges[beam] * per_cell
            if dx * dx + dy * dy <= reach * reach:
                grid[word] |= np.uint64(1) << np.uint64(line | (column & 7))
                new += 1
        first += count
    return new


@kernel()
def cut_patch(
    ground: Ground, i: int, pose: np.ndarray, patch_cell: float, width: int, patch: np.ndarray
) -> None:
    """Fill `patch`, row by row of `width` cells, with robot i's ground: 1 covered, -1 not.

    The cells, of side `patch_cell` (m), lie around `pose`: row 0 farthest ahead of it, column 0
    farthest to its left.
    """
    grid, side, cell, centre = ground.grids[i], ground.sides[i], ground.cell, ground.centres[i]
    size, words = np.uint64(side), np.uint64(side // 8)
    cos, sin = math.cos(pose[2]) * patch_cell / cell, math.sin(pose[2]) * patch_cell / cell
    middle_x = (pose[0] - centre[0]) / cell + side / 2
    middle_y = (pose[1] - centre[1]) / cell + side / 2
    left = (width - 1) / 2
    step_x, step_y = np.uint64(np.int64(sin * _ONE)), np.uint64(np.int64(-cos * _ONE))
    for row in range(width):
        forward = (width - 1) / 2 - row
        x = np.uint64(np.int64((middle_x + cos * forward - sin * left) * _ONE))
        y = np.uint64(np.int64((middle_y + sin * forward + cos * left) * _ONE))
        for column in range(width):
            on_grid = x >> _WHOLE < size and y >> _WHOLE < size
            # Nothing branches by what is covered, which cannot be foreseen.
            covered = _bit_at(grid, words, x, y) if on_grid else np.uint64(0)
            patch[row * width + column] = _SIGNS[covered]
            x += step_x
            y += step_y


@kernel()
def _bit_at(grid: np.ndarray, words: np.uint64, x: np.uint64, y: np.uint64) -> np.uint64:
    """Whether the cell at a fixed-point place on the grid, with so many words a row, is covered."""
    word = grid[(y >> _BLOCK) * words + (x >> _BLOCK)]
    bit = ((y >> np.uint64(29)) & np.uint64(56)) | ((x >> _WHOLE) & np.uint64(7))
    return np.uint64((word >> bit) & np.uint64(1))


@kernel()
def find_frontier(
    ground: Ground,
    i: int,
    pose: np.ndarray,
    sight: Sight,
    ranges: np.ndarray,
    frontier: np.ndarray,
) -> None:
    """Fill `frontier` with how far (m) robot i's uncovered ground is in as many equal sectors.

    Along the middle beam; infinitely far where the beam ends before. It begins where the cells
    on the beam and to both its sides are uncovered: beside a wall there are some whose middles
    lie within it.
    """
    grid, side, cell, centre = ground.grids[i], ground.sides[i], ground.cell, ground.centres[i]
    heading = pose[2] + sight.first
    eye_x = pose[0] + math.cos(pose[2]) * sight.x - math.sin(pose[2]) * sight.y - centre[0]
    eye_y = pose[1] + math.sin(pose[2]) * sight.x + math.cos(pose[2]) * sight.y - centre[1]
    half, sectors = side / 2, frontier.shape[0]
    for k in range(sectors):
        beam = (2 * k + 1) * ranges.shape[0] // (2 * sectors)
        bearing = heading + beam * sight.spacing
        cos, sin = math.cos(bearing), math.sin(bearing)
        frontier[k] = math.inf
        reach = min(ranges[beam], side * cell) - cell
        for step in range(1, int(reach / cell) + 1):
            x, y = eye_x / cell + half + step * cos, eye_y / cell + half + step * sin
            if not (
                _is_covered(grid, side, x, y)
                or _is_covered(grid, side, x - sin, y + cos)
                or _is_covered(grid, side, x + sin, y - cos)
            ):
                frontier[k] = step * cell
                break


@kernel()
def is_covered(ground: Ground, i: int, x: float, y: float) -> bool:
    """Whether a point (m) is on ground that robot i has covered."""
    side, half = ground.sides[i], ground.sides[i] / 2
    x, y = (x - ground.centres[i, 0]) / ground.cell, (y - ground.centres[i, 1]) / ground.cell
    return _is_covered(ground.grids[i], side, x + half, y + half)


@kernel()
def _is_covered(grid: np.ndarray, side: int, x: float, y: float) -> bool:
    """Whether a point (cells from the corner of the square) is on covered ground."""
    if not (0.0 <= x < side and 0.0 <= y < side):
        return False
    column, row = int(x), int(y)
    word = grid[(row >> 3) * (side // 8) + (column >> 3)]
    return bool((word >> np.uint64(((row & 7) << 3) | (column & 7))) & np.uint64(1))
