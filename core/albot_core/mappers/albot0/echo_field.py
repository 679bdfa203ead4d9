"""The squared distance from any point to the nearest of some echoes, on a grid."""

from __future__ import annotations

import math

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot0.steps import PLACES, SONARS, Steps

CELL = 0.1
"""Size of a cell (m)…"""
_CELL_SQUARE = 100
"""…and its square (cm²)."""
_CLEAR = 0.2
"""The sound's way is marked as free at points this far apart (m), up to this distance before the
echo. It is three cells wide."""


class EchoField:
    """A likelihood field: the squared distance to the nearest echo, up to a limit.

    The limit is lower where no sound went, because an echo there may come from a surface not heard
    yet.

    Attributes:
        corner: (2,): corner of the first cell (m).
        squares: (columns, rows), int32: the squared distance in each cell (cm²). The outermost
            cells, which stand for everything outside, are far from all echoes. Values are integers,
            so that their sums are the same in whatever order a processor adds them.

    Args:
        steps: The steps on which the echoes were heard.
        farthest: The limit where the sound went freely (m).
        unknown: The limit elsewhere (m).
    """

    def __init__(self, steps: Steps, farthest: float, unknown: float) -> None:
        self.corner = np.zeros(2)
        self.squares = np.full((1, 1), _square(unknown), np.int32)
        if steps.heard.any():
            reach = math.ceil(max(farthest, unknown) / CELL) + 1
            limits = _square(farthest), _square(unknown)
            self.corner, self.squares = _field(
                steps.lines, steps.echoes, steps.heard, reach, limits
            )


def _square(distance: float) -> int:
    """Return the square (cm²) of a distance (m)."""
    return round((100.0 * distance) ** 2)


@kernel(arrays=True)
def _field(
    lines: np.ndarray,
    echoes: np.ndarray,
    heard: np.ndarray,
    reach: int,
    limits: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corner and the squares of the field of at least one echo.

    Args:
        lines: The lines of the steps (see `Steps`).
        echoes: The echoes of the steps (see `Steps`).
        heard: Which echoes were heard (see `Steps`).
        reach: Number of cells beyond which an echo has no effect.
        limits: The squares where the sound went freely, and elsewhere (cm²).
    """
    free, unknown = limits
    rays = _rays(lines, echoes, heard)
    corner, size = np.empty(2), np.empty(2, np.int64)
    for axis in range(2):
        ends = rays[:, axis::2]
        corner[axis] = ends.min() - reach * CELL
        size[axis] = int((ends.max() - corner[axis]) / CELL) + reach + 1
    squares = np.full((size[0], size[1]), unknown, np.int32)
    for k in range(rays.shape[0]):
        _pass(rays[k], corner, squares, free)
    # First the limits where the sound went, then the lower values around each echo.
    is_echo = np.zeros(squares.shape, np.bool_)
    for k in range(rays.shape[0]):
        column, row = int((rays[k, 2] - corner[0]) / CELL), int((rays[k, 3] - corner[1]) / CELL)
        if not is_echo[column, row]:
            is_echo[column, row] = True
            for i in range(-reach, reach + 1):
                for j in range(-reach, reach + 1):
                    square = _CELL_SQUARE * (i * i + j * j)
                    if square < squares[column + i, row + j]:
                        squares[column + i, row + j] = square
    return corner, squares


@kernel(arrays=True)
def _rays(lines: np.ndarray, echoes: np.ndarray, heard: np.ndarray) -> np.ndarray:
    """Return the robot's position at each echo and the echo's origin, (echoes, 4) (m)."""
    rays, count = np.empty((heard.size, 4)), 0
    for step in range(lines.shape[0]):
        x, y, to_x, to_y = lines[step]
        east, north = to_x - x, to_y - y
        length = math.hypot(east, north)
        for k in range(heard.shape[1]):
            if heard[step, k]:
                share = (k // SONARS + 0.5) / PLACES
                ahead, left = echoes[step, k, 0] / length, echoes[step, k, 1] / length
                rays[count, 0] = x + share * east
                rays[count, 1] = y + share * north
                rays[count, 2] = x + ahead * east - left * north
                rays[count, 3] = y + ahead * north + left * east
                count += 1
    return rays[:count]


@kernel()
def _pass(ray: np.ndarray, corner: np.ndarray, squares: np.ndarray, limit: int) -> None:
    """Write a limit (cm²) into the cells through which the sound of an echo went."""
    east, north = ray[2] - ray[0], ray[3] - ray[1]
    away = math.hypot(east, north)
    gone = _CLEAR
    while gone < away - _CLEAR:
        share = gone / away
        column = int((ray[0] + share * east - corner[0]) / CELL)
        row = int((ray[1] + share * north - corner[1]) / CELL)
        for i in range(column - 1, column + 2):
            for j in range(row - 1, row + 2):
                squares[i, j] = limit
        gone += _CLEAR
