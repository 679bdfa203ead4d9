"""The compiled halves of `flood`, written for a short time of compilation, too."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel

BLOCKED = 1
"""A lattice point too near a wall."""
REACHED = 2
"""A lattice point that the disc gets to."""


@kernel()
def block(
    state: np.ndarray,
    rows: int,
    walls: np.ndarray,
    boxes: np.ndarray,
    corner_x: float,
    corner_y: float,
    cell: float,
    clearance: float,
) -> None:
    """Mark the lattice points nearer to a wall than `clearance`.

    Args:
        state: Zeros, column by column, filled in.
        rows: How many there are in a column.
        walls: Segments (n, 4).
        boxes: For each wall the points to look at (n, 4): the first and the last column,
            the first and the last row.
        corner_x: Where the first column lies.
        corner_y: Where the first row lies.
        cell: Distance of neighbouring points.
        clearance: How near a wall may be.
    """
    for index in range(len(walls)):
        x1, y1 = walls[index, 0], walls[index, 1]
        along_x, along_y = walls[index, 2] - x1, walls[index, 3] - y1
        squared = along_x * along_x + along_y * along_y
        for column in range(boxes[index, 0], boxes[index, 1] + 1):
            from_x = corner_x + column * cell - x1
            for row in range(boxes[index, 2], boxes[index, 3] + 1):
                from_y = corner_y + row * cell - y1
                share = (from_x * along_x + from_y * along_y) / squared
                if share < 0.0:
                    share = 0.0
                if share > 1.0:
                    share = 1.0
                gap_x, gap_y = from_x - share * along_x, from_y - share * along_y
                if gap_x * gap_x + gap_y * gap_y < clearance * clearance:
                    state[column * rows + row] = BLOCKED


@kernel()
def fill(state: np.ndarray, rows: int, waiting: np.ndarray) -> None:
    """Mark the points joined to the first by steps to one of the four neighbours.

    Args:
        state: As `block` left it, changed in place.
        rows: How many points there are in a column.
        waiting: Holds the index of the first; room for four times as many as there are.
    """
    count = 1
    while count:
        count -= 1
        here = waiting[count]
        if state[here] != 0:
            continue
        state[here] = REACHED
        row = here % rows
        if row > 0:
            waiting[count] = here - 1
            count += 1
        if row + 1 < rows:
            waiting[count] = here + 1
            count += 1
        if here >= rows:
            waiting[count] = here - rows
            count += 1
        if here + rows < len(state):
            waiting[count] = here + rows
            count += 1
