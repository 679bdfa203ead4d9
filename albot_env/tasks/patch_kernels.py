"""Compiled patches: the ground around a robot, turned as the robot is."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.kernels.simd import LANES, UInt64Table, UInt64Vector, uint64_predicate
from albot_env.tasks.ground_kernels import Ground

_ONE = 2.0**32
"""A cell in fixed-point numbers, in which loops over cells need no conversions: a negative
cell, taken as unsigned, is beyond every grid."""
_LANES = np.uint64(LANES)
_CELLS = (np.arange(1 << LANES)[:, np.newaxis] >> np.arange(LANES) & 1) * 2.0 - 1.0
_SIGNS = _CELLS.astype(np.float32)
"""What is shown of cells in lanes, by which of them are covered: 1 for those, else -1."""


@kernel()
def cut_patch(
    ground: Ground,
    i: int,
    pose: np.ndarray,
    turn: tuple[float, float],
    patch_cell: float,
    width: int,
    patch: np.ndarray,
) -> None:
    """Fill `patch`, row by row of `width` cells, with robot i's ground: 1 covered, -1 not.

    The cells, of side `patch_cell` (m), lie around `pose`: row 0 farthest ahead of it, column 0
    farthest to its left. `turn` is the cosine and sine of the pose's heading.
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
            _show(covered, width - first, patch, row * width + first)
            x += _LANES * step_x
            y += _LANES * step_y


@kernel()
def _show(covered: int, rest: int, patch: np.ndarray, place: int) -> None:
    """Write into a patch cells in lanes, at most `rest`, by which of them are covered."""
    begin, signs = np.uint64(place), np.uint64(covered)
    if rest >= LANES:
        # A loop whose length is known, over places that cannot be negative, is two instructions.
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
    """Which cells of a row of a patch are covered, of eight whose first is at x, y.

    Places and steps are fixed-point cells of a grid; that begins so many words from the first
    one's, has so many cells along a side and so many words a row.
    """
    x, y = x.stepped(step_x), y.stepped(step_y)
    on_grid = (x >> 32 < size) & (y >> 32 < size)
    word = grids.at(begin + (y >> 35) * words + (x >> 35), on_grid)
    return (word >> ((y >> 29) & 56 | (x >> 32) & 7)).is_odd()
