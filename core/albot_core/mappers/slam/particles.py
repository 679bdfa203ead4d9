"""Particles with a grid map each; grids share the tiles in which they do not differ."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Int32, Int64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid, integrate_scan
from albot_core.mappers.slam.particle_paths import ParticlePaths
from albot_core.mappers.slam.tiles import (
    MOST_TILES,
    NONE,
    TILE,
    PoolArrays,
    TilePool,
    extend_index,
    release_tiles,
    tiles_around,
)
from albot_core.sensing.reading import LaserScan

_CELLS = f"tiles {TILE} {TILE}"


def _check_index(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the grids use each tile, and are no larger than any building."""
    index = state["particles.index"]
    used, tiles = np.unique(index[index != NONE]), sizes["tiles"]
    is_right = len(used) == tiles
    refuse_unless(is_right, "particles.index", f"each of {tiles} tiles", f"{len(used)} of them")
    expected, found = f"at most {MOST_TILES} tiles each", index[0].size
    refuse_unless(found <= MOST_TILES, "particles.index", expected, found)


class Particles(ParticlePaths):
    """Particles with a grid each, which start at the origin of the map.

    Args:
        count: Number of particles.
        config: Parameters of the grids.
    """

    SCHEMA = Schema(
        *ParticlePaths.SCHEMA.fields,
        Field("particles.tiles", _CELLS, np.float32, at=None, least="lowest", most="highest"),
        Field(
            "particles.index",
            "particles rows columns",
            np.int32,
            at=None,
            least=NONE,
            below="tiles",
        ),
        Field("particles.corner", "2", int, at="corner", least=-(1 << 30), most=1 << 30),
        rules=(_check_index,),
    )

    def __init__(self, count: int, config: GridConfig) -> None:
        self._config = config
        super().__init__(count)

    def clear(self) -> None:
        """Reset all particles to the origin, with empty maps."""
        super().clear()
        self.pool = TilePool()
        """The tiles of all grids."""
        self.index: Int32[np.ndarray, "particles rows columns"]
        self.index = np.full((self.count, 0, 0), NONE, np.int32)
        """The tiles of each grid; `NONE` where nothing is known."""
        self.corner: Int64[np.ndarray, "2"] = np.zeros(2, np.int64)
        """Row and column of the first entries, counted in tiles from the map's origin."""

    def grid(self, particle: int) -> LogOddsGrid:
        """Return the map of a particle; it is valid until the next scan or resampling."""
        grid = LogOddsGrid(self._config, self.pool)
        grid.index, grid.corner = self.index[particle], self.corner
        return grid

    def integrate(self, scan: LaserScan) -> None:
        """Enter a scan into each map, at its particle's pose. All maps share the first scan.

        Raises:
            InputError: The grids would become larger than `MOST_TILES` tiles.
        """
        config, geometry = self._config, scan.geometry
        poses = self.poses if self.updates else self.poses[:1]
        hits = scan.ranges[(scan.ranges > 0.0) & (scan.ranges < geometry.max_range)]
        far = min(config.reach, float(hits.max(initial=0.0))) + config.cell
        far += float(np.hypot(*geometry.mount[:2]))
        tiles, side = 0, TILE * config.cell
        for x, y, _ in poses.tolist():
            low, high = tiles_around(x, y, far, config.cell)
            self.index, self.corner = extend_index(self.index, self.corner, low, high, side)
            tiles += int(np.prod(high - low))
        self.pool.reserve(tiles)
        half = int(np.ceil(far / config.cell)) + 1
        _integrate_all(
            self.pool.arrays,
            self.index,
            self.corner,
            poses,
            (config.cell, config.reach, geometry.max_range, *geometry.mount[:2]),
            config.log_odds,
            scan.ranges,
            geometry.directions,
            *self.pool.marks(half),
        )
        if len(poses) < self.count:
            self.index[1:] = self.index[0]
            self.pool.arrays.uses[self.index[0][self.index[0] != NONE]] += self.count - 1

    def _take_maps(self, chosen: Int64[np.ndarray, "particles"]) -> None:
        drawn = self.index[chosen]
        np.add.at(self.pool.arrays.uses, drawn[drawn != NONE], 1)
        for index in self.index:
            release_tiles(self.pool.arrays, index)
        self.index = drawn

    def _sizes(self) -> dict[str, Any]:
        return {**super()._sizes(), **self._config.bounds}

    def _stored(self) -> dict[str, Any]:
        # Each tile once, in the order of its first use.
        tiles, first = np.unique(self.index[self.index != NONE], return_index=True)
        tiles = tiles[np.argsort(first)]
        number = np.full(len(self.pool.arrays.uses) + 1, NONE, np.int32)
        number[tiles] = np.arange(len(tiles))
        return {
            **super()._stored(),
            "particles.tiles": self.pool.arrays.cells[tiles],
            "particles.index": number[self.index],  # The last entry of `number` maps `NONE`.
        }

    def _restored(self, state: Arrays) -> None:
        super()._restored(state)
        self.index = state["particles.index"].copy()
        # Their maps share tiles as before. The pool hands out the lowest indices first.
        self.pool, tiles = TilePool(), state["particles.tiles"]
        self.pool.reserve(len(tiles))
        cells, uses, _, free_count = self.pool.arrays
        cells[: len(tiles)] = tiles
        uses[: len(tiles)] = np.bincount(self.index[self.index != NONE], minlength=len(tiles))
        free_count[0] -= len(tiles)


@kernel(nogil=True)
def _integrate_all(
    pool: PoolArrays,
    index: np.ndarray,
    corner: np.ndarray,
    poses: np.ndarray,
    lengths: tuple[float, float, float, float, float],
    log_odds: np.ndarray,
    ranges: np.ndarray,
    directions: np.ndarray,
    marks: np.ndarray,
    touched: np.ndarray,
) -> None:
    """Enter a scan into each map (see `integrate_scan`)."""
    cell, reach, nothing, mount_x, mount_y = lengths
    for k in range(len(poses)):
        cos, sin = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        x = poses[k, 0] + cos * mount_x - sin * mount_y
        y = poses[k, 1] + sin * mount_x + cos * mount_y
        integrate_scan(
            pool,
            index[k],
            corner,
            cell,
            log_odds,
            (x, y, poses[k, 2]),
            ranges,
            directions,
            (reach, nothing),
            marks,
            touched,
        )
