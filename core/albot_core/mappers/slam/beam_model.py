"""Comparison of a scan with a grid map: the beam model of the authors' GMapping program.

G. Grisetti, C. Stachniss and W. Burgard, openslam.org/gmapping.html (`scanmatcher.h`, functions
`score` and `likelihoodAndScore`). A beam is assumed to end in the nearest occupied cell among its
expected end cell and that cell's eight neighbours. Here these nine cells are looked up once for all
poses of a scan and stored as the bits of a number; a table gives the score of a beam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.tiles import NONE, TILE, PoolArrays, log_odds_at
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

_MARGIN = 1.0
"""Width of the margin around the beams' expected ends that is cut out of the map (m)."""
_PARTS = 4
"""The end of a beam within its cell is rounded to one of this many parts, in each of x and y."""

_NEGATIVE = Range("a number below 0", -math.inf, math.nextafter(0.0, -1.0))


@dataclass(frozen=True, kw_only=True)
class BeamConfig:
    """Comparison of beams with a map. Defaults are GMapping's own, except where noted."""

    spacing: float = 0.1
    """Smallest distance between the ends of two beams that are used (m); not in GMapping, whose
    program uses all beams, or every n-th."""
    sigma: float = 0.05
    """Scale of a beam's squared distance in scan matching (m²)."""
    likelihood_sigma: float = 0.075
    """Scale of a beam's squared distance in likelihoods (m²) (lsigma)."""
    null: float = -0.5
    """Log-likelihood of a beam that ends far from every occupied cell, times `likelihood_sigma`
    (m²): the program divides it by lsigma, as it divides squared distances."""
    gain: float = 3.0
    """Number of beams that carry as much information as one independent beam (ogain)."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "spacing")
        check_fields(self, POSITIVE, "sigma", "likelihood_sigma", "gain")
        check_fields(self, _NEGATIVE, "null")


class BeamTables(NamedTuple):
    """The fit of one beam to a map, by what is around its end (see `beam_tables`)."""

    scores: Float64[np.ndarray, "masks parts"]
    log_likelihoods: Float64[np.ndarray, "masks parts"]


def beam_tables(config: BeamConfig, cell: float) -> BeamTables:
    """Return the score and the log-likelihood of one beam.

    The rows are the occupancy of the beam's end cell and its eight neighbours, as bits, row by row;
    the columns are the part of the cell in which the beam ends. The nearest occupied cell counts
    (the program's `kernelSize` 1). The distance is to the centre of that cell; the program uses the
    mean of all beam ends in it.
    """
    masks = np.arange(1 << 9)[:, None, None]
    rows, columns = np.divmod(np.arange(9), 3)
    up, across = (np.divmod(np.arange(_PARTS**2), _PARTS) + np.array(0.5)) / _PARTS
    squared = (across[:, None] - columns + 0.5) ** 2 + (up[:, None] - rows + 0.5) ** 2
    is_occupied = (masks >> np.arange(9)) & 1 == 1
    nearest = np.where(is_occupied, squared * cell**2, np.inf).min(axis=-1)
    fits = np.where(np.isfinite(nearest), -nearest, config.null)
    log_likelihoods = fits / (config.likelihood_sigma * config.gain)
    return BeamTables(np.exp(-nearest / config.sigma), log_likelihoods)


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
    """Return the fit of a scan to a map from a pose: the sum of the table's value for each beam."""
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
    """Cut out the map around the beams' ends: the occupancy of each cell and its eight neighbours.

    A cell counts only if the next cell towards the robot is not occupied. The program makes this
    test for every beam, to check that the beam passed through free space.

    Returns:
        The occupancy bits (rows, columns), and row and column of the first cell in the map.
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
