"""Compiled loops over coverage grids: marking cells, finding the frontier, cutting patches.

A coverage grid is a square of cells, one bit each. A word holds a block of 8 × 8 cells, so that
the surroundings of a robot are close together in memory: column x, row y is bit
8 (y % 8) + x % 8 of word (x // 8) + words per row × (y // 8).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import (
    length_of,
    pseudo_angle,
    rotate_back,
    transform_point,
)
from albot_core.kernels.bits import lowest_bit, popcount
from albot_core.kernels.compiled import kernel
from albot_core.kernels.simd import (
    LANES,
    FloatTable,
    FloatVector,
    UInt64Table,
    UInt64Vector,
    float32_predicate,
    uint64_predicate,
)

_CELLS = np.stack((np.arange(16) % 8, np.arange(16) // 8)).astype(np.float32)
"""Columns and rows of the cells in the first two rows of a block."""
_SOFT = 0.01
"""Tolerance (cells) of the float32 preselection of near cells, before the float64 test."""


class CoverageGrid(NamedTuple):
    """Coverage grids of robots, one row per robot. Ground beyond a grid never counts as covered."""

    grids: np.ndarray
    """(n, words) uint64: one bit per cell, set if covered."""
    sides: np.ndarray
    """(n,) int64: number of cells along each side; a multiple of eight."""
    centres: np.ndarray
    """(n, 2) float64: centres of the grids (m)."""
    cell: float
    """Side of a cell (m)."""


class CoverageSensor(NamedTuple):
    """A laser's field of view on the ground."""

    radius: float
    """Ground farther from the laser than this is not covered (m)."""
    x: float
    """Position x of the laser on the robot (m)."""
    y: float
    """Position y of the laser on the robot (m)."""
    first: float
    """Bearing of the first beam from the robot's heading (rad)."""
    spacing: float
    """Angle between adjacent beams (rad)."""
    beams: np.ndarray
    """(parts,) int64: the beam that points into each part of the full turn (see `pseudo_angle`);
    -1 if none does."""
    ahead: float
    """Minimum cosine, over all beams, of the bearing from the robot's heading."""


@kernel()
def accumulate_motion(motion: np.ndarray, spacing: float, turn: float, moved: np.ndarray) -> bool:
    """Add a motion to `moved` (m, rad) since the last update; return whether an update is due.

    If one is due, `moved` is reset to zero.
    """
    moved[0] += length_of(motion[0], motion[1])
    moved[1] += abs(motion[2])
    if moved[0] < spacing and moved[1] < turn:
        return False
    moved[0] = moved[1] = 0.0
    return True


@kernel()
def cover(
    ground: CoverageGrid,
    i: int,
    pose: np.ndarray,
    turn: tuple[float, float],
    sensor: CoverageSensor,
    ranges: np.ndarray,
) -> int:
    """Mark the cells of robot i whose centres are seen by a scan taken at `pose`.

    A centre is seen if it is within the radius and within the range of the beam that points to
    it. Cells outside the grid are ignored. `turn` is the cosine and sine of the pose's heading.
    Returns the number of newly covered cells.
    """
    side, cell, centre = ground.sides[i], ground.cell, ground.centres[i]
    cos, sin = turn
    # The laser's position, in cells from the centre of cell (0, 0).
    laser_x, laser_y = transform_point(pose, cos, sin, sensor.x, sensor.y)
    eye_x = (laser_x - centre[0]) / cell + side / 2 - 0.5
    eye_y = (laser_y - centre[1]) / cell + side / 2 - 0.5
    eye, radius = (eye_x, eye_y, cos, sin), sensor.radius / cell
    first, last = max(0, math.ceil(eye_x - radius)), min(side - 1, math.floor(eye_x + radius))
    low, high = max(0, math.ceil(eye_y - radius)), min(side - 1, math.floor(eye_y + radius))
    grid, words, new = ground.grids[i], side // 8, 0
    far, least = radius + _SOFT, radius * min(sensor.ahead, 0.0) - _SOFT
    within = np.float32(cos), np.float32(sin), np.float32(far * far), np.float32(least)
    for y in range(low >> 3, (high >> 3) + 1):
        for x in range(first >> 3, (last >> 3) + 1):
            word = y * words + x
            # Most cells are already covered and need no test.
            near = _near(_CELLS, 0, (np.float32(eye_x - 8 * x), np.float32(eye_y - 8 * y), *within))
            hidden = int(~grid[word]) & near
            if hidden:
                seen = _seen(hidden, (8 * x, 8 * y), eye, 1.0 / cell, sensor, ranges)
                grid[word] |= np.uint64(seen)
                new += popcount(seen)
    return new


@float32_predicate
def _near(cells: FloatTable, *eye: FloatVector) -> tuple[FloatVector, ...]:
    """Return which cells of a block are within a distance of the laser and not behind it.

    It tests two rows at a time. `eye` is the laser's position (cells from the centre of the block's
    first cell), the cosine and sine of the robot's heading, the squared distance (cells²), and the
    minimum distance ahead (cells). The test is float32, so both limits need a tolerance (`_SOFT`).
    """
    x, y, cos, sin, far2, least = eye
    dx, dy = cells[0] - x, cells[1] - y
    rows = [dy + row for row in range(0, 8, 2)]
    return tuple((dx * dx + dy * dy <= far2) & (cos * dx + sin * dy >= least) for dy in rows)


@kernel()
def _seen(
    cells: int,
    corner: tuple[int, int],
    eye: tuple[float, float, float, float],
    per_cell: float,
    sensor: CoverageSensor,
    ranges: np.ndarray,
) -> int:
    """Return which of some cells of the block at `corner` (column, row) are seen by a scan."""
    beams, radius = sensor.beams, sensor.radius * per_cell
    x, y, cos, sin = eye
    parts, shown = beams.shape[0], 0
    while cells:
        place = lowest_bit(cells)
        cells &= cells - 1
        dx, dy = corner[0] + (place & 7) - x, corner[1] + (place >> 3) - y
        u, v = rotate_back(cos, sin, dx, dy)
        beam = beams[min(int((pseudo_angle(u, v) + 2.0) * 0.25 * parts), parts - 1)]
        if beam < 0:
            continue
        reach = min(ranges[beam] * per_cell, radius)
        if dx * dx + dy * dy <= reach * reach:
            shown |= 1 << place
    return shown


@kernel()
def find_frontier(
    ground: CoverageGrid,
    i: int,
    pose: np.ndarray,
    sensor: CoverageSensor,
    ranges: np.ndarray,
    frontier: np.ndarray,
) -> None:
    """Fill `frontier` with the distance (m) of robot i's uncovered ground in equal sectors.

    The distance is along the middle beam of each sector; infinite if the beam ends first. The
    frontier is where the cells on the beam and on both sides of it are uncovered: beside a wall,
    single cells stay uncovered because their centres lie inside it.
    """
    grid, side, cell, centre = ground.grids[i], ground.sides[i], ground.cell, ground.centres[i]
    heading = pose[2] + sensor.first
    eye_x = pose[0] + math.cos(pose[2]) * sensor.x - math.sin(pose[2]) * sensor.y - centre[0]
    eye_y = pose[1] + math.sin(pose[2]) * sensor.x + math.cos(pose[2]) * sensor.y - centre[1]
    half, sectors = side / 2, frontier.shape[0]
    for k in range(sectors):
        beam = (2 * k + 1) * ranges.shape[0] // (2 * sectors)
        bearing = heading + beam * sensor.spacing
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
def is_covered(ground: CoverageGrid, i: int, x: float, y: float) -> bool:
    """Whether a point (m) is on ground that robot i has covered."""
    side, half = ground.sides[i], ground.sides[i] / 2
    x, y = (x - ground.centres[i, 0]) / ground.cell, (y - ground.centres[i, 1]) / ground.cell
    return _is_covered(ground.grids[i], side, x + half, y + half)


@kernel()
def _is_covered(grid: np.ndarray, side: int, x: float, y: float) -> bool:
    """Whether a point (cells from the grid's corner) is on covered ground."""
    if not (0.0 <= x < side and 0.0 <= y < side):
        return False
    column, row = int(x), int(y)
    word = grid[(row >> 3) * (side // 8) + (column >> 3)]
    return bool((word >> np.uint64(((row & 7) << 3) | (column & 7))) & np.uint64(1))


_ONE = 2.0**32
"""One cell in fixed-point numbers, which spare the loops conversions: a negative cell, read as
unsigned, is outside every grid."""
_LANES = np.uint64(LANES)
_PATTERNS = (np.arange(1 << LANES)[:, np.newaxis] >> np.arange(LANES) & 1) * 2.0 - 1.0
_SIGNS = _PATTERNS.astype(np.float32)
"""Patch values of the cells in a vector, by the bits of covered cells: 1 if covered, else -1."""


@kernel()
def cut_patch(
    ground: CoverageGrid,
    i: int,
    pose: np.ndarray,
    turn: tuple[float, float],
    patch_cell: float,
    width: int,
    patch: np.ndarray,
) -> None:
    """Fill `patch`, row by row of `width` cells, with robot i's ground: 1 covered, -1 not.

    The cells, of side `patch_cell` (m), surround `pose`: row 0 is farthest ahead, column 0
    farthest to the left. `turn` is the cosine and sine of the pose's heading.
    """
    side, cell, centre = ground.sides[i], ground.cell, ground.centres[i]
    begin, size, words = np.uint64(i * ground.grids.shape[1]), np.uint64(side), np.uint64(side // 8)
    cos, sin = turn[0] * patch_cell / cell, turn[1] * patch_cell / cell
    middle_x = (pose[0] - centre[0]) / cell + side / 2
    middle_y = (pose[1] - centre[1]) / cell + side / 2
    left = (width - 1) / 2
    step_x, step_y = np.uint64(np.int64(sin * _ONE)), np.uint64(np.int64(-cos * _ONE))
    for row in range(width):
        forward = (width - 1) / 2 - row
        x = np.uint64(np.int64((middle_x + cos * forward - sin * left) * _ONE))
        y = np.uint64(np.int64((middle_y + sin * forward + cos * left) * _ONE))
        for first in range(0, width, LANES):
            line = x, y, step_x, step_y
            covered = _are_covered(ground.grids, 0, (begin, size, words, *line))
            _show_cells(covered, width - first, patch, row * width + first)
            x += _LANES * step_x
            y += _LANES * step_y


@kernel()
def _show_cells(covered: int, rest: int, patch: np.ndarray, place: int) -> None:
    """Write the values of a vector of cells, at most `rest`, into a patch."""
    begin, signs = np.uint64(place), np.uint64(covered)
    if rest >= LANES:
        # With a known length and non-negative indices, this loop compiles to two instructions.
        for lane in range(_LANES):
            patch[begin + lane] = _SIGNS[signs, lane]
    else:
        for lane in range(np.uint64(rest)):
            patch[begin + lane] = _SIGNS[signs, lane]


@uint64_predicate
def _are_covered(
    grids: UInt64Table,
    begin: UInt64Vector,
    size: UInt64Vector,
    words: UInt64Vector,
    x: UInt64Vector,
    y: UInt64Vector,
    step_x: UInt64Vector,
    step_y: UInt64Vector,
) -> UInt64Vector:
    """Return which of eight cells in a row of a patch, the first at x, y, are covered.

    Positions and steps are in fixed-point cells. `begin` is the offset (words) of the robot's grid,
    `size` its number of cells along a side, `words` its number of words per row.
    """
    x, y = x.stepped(step_x), y.stepped(step_y)
    on_grid = (x >> 32 < size) & (y >> 32 < size)
    word = grids.at(begin + (y >> 35) * words + (x >> 35), on_grid)
    return (word >> ((y >> 29) & 56 | (x >> 32) & 7)).is_odd()
