"""How a scan is compared with a grid map: the beams' model of GMapping's program.

G. Grisetti, C. Stachniss and W. Burgard, openslam.org/gmapping.html (`scanmatcher.h`, functions
`score` and `likelihoodAndScore`). A beam is taken to have ended in the nearest occupied cell of
that in which it should end and the eight around it. Here these nine are looked up once for all
poses of a scan, as the bits of a number; a table then says what a beam is worth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.tiles import NONE, TILE, PoolArrays, log_odds_at
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields

_MARGIN = 1.0
"""Beams are compared with the map this far around where they should end (m)."""
_PARTS = 4
"""The end of a beam is placed within its cell to one of so many by so many parts."""


@dataclass(frozen=True, kw_only=True)
class BeamConfig:
    """How beams are compared with a map: the defaults are the program's, unless said."""

    spacing: float = 0.1
    """Of beams that end nearer to each other (m) one is compared with the map; ours. The program
    compares all, or every n-th."""
    sigma: float = 0.05
    """Scale of a beam's squared distance (m²), where scans are matched."""
    likelihood_sigma: float = 0.075
    """Scale of the squared distance (m²), where likelihoods are compared (lsigma)."""
    null: float = -0.5
    """Logarithm of the likelihood of a beam that ends where nothing is known to be."""
    gain: float = 3.0
    """So many beams tell no more than one that is independent of all others (ogain)."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "spacing")
        check_fields(self, POSITIVE, "sigma", "likelihood_sigma", "gain")
        if not -math.inf < self.null < 0.0:
            raise InputError("BeamConfig.null", "a number below 0", str(self.null))


def beam_tables(
    config: BeamConfig, cell: float
) -> tuple[Float64[np.ndarray, "masks parts"], Float64[np.ndarray, "masks parts"]]:
    """Score, and logarithm of the likelihood, of one beam.

    By what is occupied of its cell and the eight around it, as bits, row by row, and by the part of
    the cell in which it ends. The nearest cell counts (the program's `kernelSize` 1), by the
    distance to its middle, where the program keeps the mean of all that ended in it.
    """
    masks = np.arange(1 << 9)[:, None, None]
    rows, columns = np.divmod(np.arange(9), 3)
    up, across = (np.divmod(np.arange(_PARTS**2), _PARTS) + np.array(0.5)) / _PARTS
    squared = (across[:, None] - columns + 0.5) ** 2 + (up[:, None] - rows + 0.5) ** 2
    is_occupied = (masks >> np.arange(9)) & 1 == 1
    nearest = np.where(is_occupied, squared * cell**2, np.inf).min(axis=-1)
    log_likelihoods = np.maximum(-nearest / config.likelihood_sigma, config.null) / config.gain
    return np.exp(-nearest / config.sigma), log_likelihoods


@kernel()
def weigh_points(
    patch: np.ndarray,
    low: tuple[int, int],
    cell: float,
    points: np.ndarray,
    x: float,
    y: float,
    heading: float,
    table: np.ndarray,
) -> float:
    """How well a scan fits a map from a pose: what a table says of each beam, added up."""
    rows, columns = patch.shape
    masks, values = patch.reshape(rows * columns), table.reshape(table.size)
    cos, sin = math.cos(heading) / cell, math.sin(heading) / cell
    from_x, from_y = x / cell - low[1], y / cell - low[0]
    total = 0.0
    for k in range(len(points)):
        end_x = from_x + cos * points[k, 0] - sin * points[k, 1]
        end_y = from_y + sin * points[k, 0] + cos * points[k, 1]
        at = 0
        if 0.0 <= end_x < columns and 0.0 <= end_y < rows:
            column, row = int(end_x), int(end_y)
            at = masks[row * columns + column] * (_PARTS * _PARTS)
            at += int((end_y - row) * _PARTS) * _PARTS + int((end_x - column) * _PARTS)
        total += values[at]
    return total


@kernel(arrays=True)
def cut_patch(
    pool: PoolArrays,
    index: np.ndarray,
    corner: np.ndarray,
    cell: float,
    points: np.ndarray,
    pose: np.ndarray,
) -> tuple[np.ndarray, tuple[int, int]]:
    """What is occupied of each cell and the eight around it, as bits, around where beams end.

    A cell counts only if the one before it, towards the robot, is not occupied: the program's test
    that a beam came through there. (The program tests it beam by beam.)

    Returns:
        The bits (rows, columns), and row and column of the first cell from the map's origin.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    low_x, low_y, high_x, high_y = pose[0], pose[1], pose[0], pose[1]
    for k in range(len(points)):
        x = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        y = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        low_x, low_y = min(low_x, x), min(low_y, y)
        high_x, high_y = max(high_x, x), max(high_y, y)
    low_row, low_column = math.floor((low_y - _MARGIN) / cell), math.floor((low_x - _MARGIN) / cell)
    rows = math.floor((high_y + _MARGIN) / cell) + 1 - low_row
    columns = math.floor((high_x + _MARGIN) / cell) + 1 - low_column
    patch = np.zeros((rows, columns), np.uint16)
    eye_row, eye_column = pose[1] / cell - low_row, pose[0] / cell - low_column
    for tile_row in range(low_row // TILE, (low_row + rows - 1) // TILE + 1):
        for tile_column in range(low_column // TILE, (low_column + columns - 1) // TILE + 1):
            r, c = tile_row - corner[0], tile_column - corner[1]
            if not (0 <= r < index.shape[0] and 0 <= c < index.shape[1]) or index[r, c] == NONE:
                continue
            tile = index[r, c]
            first_row, first_column = tile_row * TILE - low_row, tile_column * TILE - low_column
            for i in range(max(0, 1 - first_row), min(TILE, rows - 1 - first_row)):
                for j in range(max(0, 1 - first_column), min(TILE, columns - 1 - first_column)):
                    if pool.cells[tile, i, j] <= 0.0:
                        continue
                    row, column = first_row + i, first_column + j
                    up, across = eye_row - row - 0.5, eye_column - column - 0.5
                    away = math.sqrt(up * up + across * across)
                    up = math.floor(1.41 * up / away + 0.5) if away > 1.0 else 0.0
                    across = math.floor(1.41 * across / away + 0.5) if away > 1.0 else 0.0
                    before_row, before_column = row + int(up), column + int(across)
                    if log_odds_at(
                        pool, index, corner, low_row + before_row, low_column + before_column
                    ) > 0.0 and (up != 0.0 or across != 0.0):
                        continue
                    for n in range(9):
                        patch[row + 1 - n // 3, column + 1 - n % 3] |= np.uint16(1 << n)
    return patch, (low_row, low_column)
