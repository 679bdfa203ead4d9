"""The log-odds occupancy grid, in tiles of cells that are made as the ground is seen.

H. Moravec and A. Elfes, High resolution maps from wide angle sonar, ICRA 1985; the parameters of
the sensor model and the bounds are those of A. Hornung et al., OctoMap, Autonomous Robots 2013. A
cell holds the logarithm of the odds that it is occupied; exactly 0 means unknown.

Several grids may share tiles (see `tiles`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.slam.tiles import (
    NONE,
    TILE,
    TILE_BITS,
    PoolArrays,
    TilePool,
    extend_index,
    fit_an_index,
    release_tiles,
    take_tile,
    tiles_around,
    writable_tile,
)
from albot_core.mappers.slam.way_home import Ground
from albot_core.mappers.stored import Stored
from albot_core.maps.layers import OccupancyGridLayer
from albot_core.ranges import POSITIVE, Range, check_fields
from albot_core.sensing.reading import LaserScan

_SHARE = Range("a number within (0, 1)", 0.0, 1.0, beyond=True)


@dataclass(frozen=True, kw_only=True)
class GridConfig:
    """Resolution of a grid, and the sensor model of a beam."""

    cell: float = 0.05
    """Side of a cell (m)."""
    reach: float = 12.0
    """Largest length of a beam that is used (m)."""
    hit: float = 0.7
    """Probability that a cell is occupied after one beam ended in it (Hornung et al. 2013)."""
    miss: float = 0.4
    """Probability that a cell is occupied after one beam crossed it (Hornung et al. 2013)."""
    least: float = 0.12
    """Lower bound of a cell's probability (Hornung et al. 2013)."""
    most: float = 0.97
    """Upper bound of a cell's probability (Hornung et al. 2013)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "cell", "reach")
        check_fields(self, _SHARE, "hit", "miss", "least", "most")
        if not self.least < self.miss < 0.5 < self.hit < self.most < 1:
            found = f"{self.least:g}, {self.miss:g}, {self.hit:g}, {self.most:g}"
            expected = "least < miss < 0.5 < hit < most < 1"
            raise InputError("GridConfig.least, miss, hit, most", expected, found)
        if self.reach / self.cell > 4096:
            expected = f"at most 4096 cells of {self.cell:g} m"
            raise InputError("GridConfig.reach", expected, f"{self.reach:g}")

    @property
    def log_odds(self) -> Float32[np.ndarray, "4"]:
        """Log odds of a hit and of a miss, and the lower and the upper bound of a cell."""
        shares = np.array((self.hit, self.miss, self.least, self.most))
        return np.log(shares / (1.0 - shares)).astype(np.float32)

    @property
    def bounds(self) -> dict[str, Any]:
        """The lowest and the highest log odds of a cell."""
        return dict(zip(("lowest", "highest"), self.log_odds[2:], strict=True))


class LogOddsGrid(Stored):
    """An occupancy grid in the map's frame.

    Args:
        config: The grid's parameters.
        pool: The pool of its tiles; None for a new pool.
    """

    SCHEMA = Schema(
        Field("grid.places", "tiles 2", int, at=None, once=True),
        Field(
            "grid.cells",
            f"tiles {TILE} {TILE}",
            np.float32,
            at=None,
            least="lowest",
            most="highest",
        ),
        rules=(fit_an_index("grid.places"),),
    )

    def __init__(self, config: GridConfig, pool: TilePool | None = None) -> None:
        self.config = config
        self.pool = TilePool() if pool is None else pool
        self.index: Int32[np.ndarray, "rows columns"] = np.full((0, 0), NONE, np.int32)
        """The tile of each square of `TILE` by `TILE` cells; `NONE` where nothing is known."""
        self.corner: Int64[np.ndarray, "2"] = np.zeros(2, np.int64)
        """Row and column of `index[0, 0]`, counted in tiles from the map's origin."""

    def integrate(self, pose: Pose, scan: LaserScan) -> None:
        """Enter a scan: free space along its beams, and occupied cells at their ends.

        A beam longer than the config's reach frees the cells up to the reach. A beam without a
        return is ignored, since the surface may be black or a mirror.

        Args:
            pose: The robot's pose in the map's frame.
            scan: The scan.

        Raises:
            InputError: The grid would become larger than `MOST_TILES` tiles.
        """
        config = self.config
        mount = scan.geometry.mount
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        eye = pose[0] + cos * mount[0] - sin * mount[1], pose[1] + sin * mount[0] + cos * mount[1]
        self.reserve(*eye, config.reach)
        integrate_scan(
            self.pool.arrays,
            self.index,
            self.corner,
            config.cell,
            config.log_odds,
            (eye[0], eye[1], float(pose[2])),
            scan.ranges,
            scan.geometry.directions,
            (config.reach, scan.geometry.max_range),
            *self.pool.marks(self._half),
        )

    def reserve(self, x: float, y: float, reach: float) -> None:
        """Reserve room for all ground within `reach` of a point (m), in the index and the pool.

        Raises:
            InputError: The index would have more than `MOST_TILES` entries.
        """
        low, high = tiles_around(x, y, reach, self.config.cell)
        side = TILE * self.config.cell
        self.index, self.corner = extend_index(self.index, self.corner, low, high, side)
        self.pool.reserve(int(np.prod(high - low)))

    def fork(self) -> LogOddsGrid:
        """Return a copy of the grid; both share each tile until one of them writes to it."""
        twin = LogOddsGrid(self.config, self.pool)
        twin.index, twin.corner = self.index.copy(), self.corner.copy()
        self.pool.arrays.uses[self.index[self.index != NONE]] += 1
        return twin

    def clear(self) -> None:
        """Forget all ground, and release the tiles that no other grid uses."""
        release_tiles(self.pool.arrays, self.index)
        self.index, self.corner = np.full((0, 0), NONE, np.int32), np.zeros(2, np.int64)

    def log_odds(self) -> tuple[Float32[np.ndarray, "rows columns"], Float64[np.ndarray, "2"]]:
        """Return all cells as one array, and x, y of the outer corner of its first cell (m).

        The array covers all known tiles.
        """
        rows, columns = np.nonzero(self.index != NONE)
        if not len(rows):
            return np.zeros((0, 0), np.float32), np.zeros(2)
        low = np.array((rows.min(), columns.min()))
        high = np.array((rows.max(), columns.max())) + 1
        part = self.index[low[0] : high[0], low[1] : high[1]]
        tiles = np.where(
            (part != NONE)[..., None, None], self.pool.arrays.cells[part], np.float32(0)
        )
        cells = tiles.transpose(0, 2, 1, 3).reshape(part.shape[0] * TILE, part.shape[1] * TILE)
        corner = ((self.corner + low)[::-1] * TILE * self.config.cell).astype(np.float64)
        return np.ascontiguousarray(cells), corner

    def ground(self, stood: Points) -> Ground:
        """Return the input of the search for a way home.

        Args:
            stood: The robot's positions so far, in order (m), (n, 2).
        """
        return Ground(*self.log_odds(), self.config.cell, stood)

    def layer(self) -> OccupancyGridLayer:
        """Return the grid as a layer of a map: probabilities, NaN where nothing is known."""
        cells, corner = self.log_odds()
        shares = 1.0 - 1.0 / (1.0 + np.exp(cells))
        return OccupancyGridLayer(
            origin=np.array((*corner, 0.0)),
            resolution=self.config.cell,
            occupancy=np.where(cells == 0, np.float32(np.nan), shares).astype(np.float32),
        )

    def _sizes(self) -> dict[str, Any]:
        return self.config.bounds

    def _stored(self) -> dict[str, np.ndarray]:
        known = np.argwhere(self.index != NONE)
        tiles = self.index[known[:, 0], known[:, 1]]
        return {"grid.places": known + self.corner, "grid.cells": self.pool.arrays.cells[tiles]}

    def _restored(self, state: Arrays) -> None:
        places, cells = state["grid.places"], state["grid.cells"]
        self.clear()
        if not len(places):
            return
        low, high = places.min(axis=0), places.max(axis=0) + 1
        self.index, self.corner = np.full(high - low, NONE, np.int32), low
        self.pool.reserve(len(places))
        for (row, column), tile in zip((places - low).tolist(), cells, strict=True):
            number = take_tile(self.pool.arrays)
            self.pool.arrays.cells[number] = tile
            self.index[row, column] = number

    @property
    def _half(self) -> int:
        """Number of cells from the laser that a beam can reach."""
        return math.ceil(self.config.reach / self.config.cell) + 1


_FREE, _HIT = np.uint8(1), np.uint8(2)
"""Bits of a cell's mark."""


@kernel()
def integrate_scan(
    pool: PoolArrays,
    index: np.ndarray,
    corner: np.ndarray,
    cell: float,
    log_odds: np.ndarray,
    eye: tuple[float, float, float],
    ranges: np.ndarray,
    directions: np.ndarray,
    reaches: tuple[float, float],
    marks: np.ndarray,
    touched: np.ndarray,
) -> None:
    """Enter a scan into a grid. Each cell is updated once; a hit takes precedence over a miss.

    Args:
        pool: The tiles, with one free tile for every tile around the laser.
        index: The grid's tiles, with room for all ground within reach (rows, columns).
        corner: Row and column of its first entry, in tiles.
        cell: Side of a cell (m).
        log_odds: Log odds of a hit and of a miss; lower and upper bound of a cell (4,).
        eye: x, y of the laser in the map (m), and the robot's heading (rad).
        ranges: Range of every beam (m), (beams,).
        directions: Unit vectors of the beams in the robot's frame (beams, 2).
        reaches: Largest length of a beam that is used (m); range that means no return (m).
        marks: Zeros, one for each cell of the square around the laser that covers all within
            reach; zeros again at the end.
        touched: Scratch buffer, one longer than `marks`: row << 16 | column of each touched cell,
            from the square's corner.
    """
    reach, nothing = reaches
    half = (round(math.sqrt(len(marks))) - 1) // 2
    width = 2 * half + 1
    cos, sin = math.cos(eye[2]), math.sin(eye[2])
    first_row, first_column = math.floor(eye[1] / cell) - half, math.floor(eye[0] / cell) - half
    # The laser's position, in cells from the square's corner.
    x0, y0 = eye[0] / cell - first_column, eye[1] / cell - first_row
    count = 0
    for k in range(len(ranges)):
        if not 0.0 < ranges[k] < nothing:
            continue
        length = min(ranges[k], reach) / cell
        ux = cos * directions[k, 0] - sin * directions[k, 1]
        uy = sin * directions[k, 0] + cos * directions[k, 1]
        column, row = int(x0), int(y0)
        end_column, end_row = int(x0 + length * ux), int(y0 + length * uy)
        # From cell to cell along the beam (J. Amanatides and A. Woo, Eurographics 1987).
        across, up = (1 if ux > 0.0 else -1), (1 if uy > 0.0 else -1)
        delta_x = abs(1.0 / ux) if ux != 0.0 else math.inf
        delta_y = abs(1.0 / uy) if uy != 0.0 else math.inf
        next_x = (column + (ux > 0.0) - x0) / ux if ux != 0.0 else math.inf
        next_y = (row + (uy > 0.0) - y0) / uy if uy != 0.0 else math.inf
        for _ in range(abs(end_column - column) + abs(end_row - row)):
            mark = row * width + column
            # Without a branch, which the processor could not predict.
            touched[count] = row << 16 | column
            count += marks[mark] == 0
            marks[mark] |= _FREE
            if next_x < next_y:
                column, next_x = column + across, next_x + delta_x
            else:
                row, next_y = row + up, next_y + delta_y
        if ranges[k] > reach:
            continue
        mark = end_row * width + end_column
        touched[count] = end_row << 16 | end_column
        count += marks[mark] == 0
        marks[mark] |= _HIT
    first_row -= corner[0] * TILE
    first_column -= corner[1] * TILE
    for k in range(count):
        row, column = touched[k] >> 16, touched[k] & 0xFFFF
        mark = row * width + column
        added = log_odds[0] if marks[mark] & _HIT else log_odds[1]
        marks[mark] = 0
        row, column = first_row + row, first_column + column
        tile = writable_tile(pool, index, row >> TILE_BITS, column >> TILE_BITS)
        row, column = row & (TILE - 1), column & (TILE - 1)
        held = pool.cells[tile, row, column] + added
        pool.cells[tile, row, column] = min(max(held, log_odds[2]), log_odds[3])
