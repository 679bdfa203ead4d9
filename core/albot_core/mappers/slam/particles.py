"""Particles: hypotheses of the robot's path, each with the map that follows from it.

A Rao-Blackwellised particle filter (A. Doucet et al., UAI 2000; K. Murphy, NIPS 1999). Each
particle holds a whole path of the robot and a grid. Grids share the tiles in which they do not
differ; paths share their common beginning.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64, Int32, Int64

from albot_core.geometry.types import Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid, integrate_scan
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
from albot_core.mappers.stored import Stored
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


class Particles(Stored):
    """Particles with a grid each, which start at the origin of the map.

    Args:
        count: Number of particles.
        config: Parameters of the grids.
    """

    SCHEMA = Schema(
        Field("particles.poses", "updates+1 particles 3", at=None),
        Field("particles.parents", "updates+1 particles", int, at=None, least=0, below="particles"),
        Field("particles.log_weights", "particles", at="log_weights"),
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
        self.count, self._config = count, config
        self.clear()

    def clear(self) -> None:
        """Reset all particles to the origin, with empty maps."""
        self.pool = TilePool()
        """The tiles of all grids."""
        self.index: Int32[np.ndarray, "particles rows columns"]
        self.index = np.full((self.count, 0, 0), NONE, np.int32)
        """The tiles of each grid; `NONE` where nothing is known."""
        self.corner: Int64[np.ndarray, "2"] = np.zeros(2, np.int64)
        """Row and column of the first entries, counted in tiles from the map's origin."""
        self.poses: Poses = np.zeros((self.count, 3))
        """The robot's pose by each particle (map frame), (particles, 3)."""
        self.log_weights: Float64[np.ndarray, "particles"] = np.zeros(self.count)
        """Log-weight of each particle, up to a common constant."""
        self._parents: Int64[np.ndarray, "particles"] = np.arange(self.count)
        self._way: list[Poses] = []
        self._lineage: list[np.ndarray] = []

    @property
    def best(self) -> int:
        """Index of the particle with the largest weight; of several equal ones, the first.

        After a resampling all weights are equal, so it is particle 0. GMapping's program chooses by
        the sum of all log-weights along a particle's path instead.
        """
        return int(np.argmax(self.log_weights))

    @property
    def updates(self) -> int:
        """Number of calls of `remember`."""
        return len(self._way)

    def weights(self, gain: float = 1.0) -> Float64[np.ndarray, "particles"]:
        """Return the particles' weights; they sum to 1.

        Args:
            gain: Factor of the log-weights; below 1 it makes the weights more equal.
        """
        raised = np.exp(gain * (self.log_weights - self.log_weights.max()))
        normalised: Float64[np.ndarray, "particles"] = raised / raised.sum()
        return normalised

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

    def remember(self) -> None:
        """Append the current poses to the particles' paths."""
        self._way.append(self.poses.copy())
        self._lineage.append(self._parents.copy())
        self._parents = np.arange(self.count)

    def trajectory(self, particle: int) -> Float64[np.ndarray, "updates 3"]:
        """Return the path of a particle: its poses at each `remember`, in order."""
        way = np.empty((self.updates, 3))
        particle = int(self._parents[particle])
        for update in range(self.updates - 1, -1, -1):
            way[update] = self._way[update][particle]
            particle = int(self._lineage[update][particle])
        return way

    def resample(self, weights: Float64[np.ndarray, "particles"], rng: np.random.Generator) -> None:
        """Resample: draw the same number of particles, with probabilities equal to the weights.

        Systematic resampling (J. Carpenter et al., IEE Proceedings 1999): one random number shifts
        an even comb. All weights are equal afterwards.
        """
        teeth = (rng.random() + np.arange(self.count)) / self.count
        chosen = np.minimum(np.searchsorted(np.cumsum(weights), teeth), self.count - 1)
        drawn = self.index[chosen]
        np.add.at(self.pool.arrays.uses, drawn[drawn != NONE], 1)
        for index in self.index:
            release_tiles(self.pool.arrays, index)
        self.index = drawn
        self.poses = self.poses[chosen]
        self.log_weights = np.zeros(self.count)
        self._parents = self._parents[chosen]

    def _sizes(self) -> dict[str, Any]:
        return {"particles": self.count, **self._config.bounds}

    def _stored(self) -> dict[str, np.ndarray]:
        # Each tile once, in the order of its first use.
        tiles, first = np.unique(self.index[self.index != NONE], return_index=True)
        tiles = tiles[np.argsort(first)]
        number = np.full(len(self.pool.arrays.uses) + 1, NONE, np.int32)
        number[tiles] = np.arange(len(tiles))
        return {
            "particles.poses": np.stack((*self._way, self.poses)),
            "particles.parents": np.stack((*self._lineage, self._parents)),
            "particles.tiles": self.pool.arrays.cells[tiles],
            "particles.index": number[self.index],  # The last entry of `number` maps `NONE`.
        }

    def _restored(self, state: Arrays) -> None:
        *self._way, self.poses = state["particles.poses"].copy()
        *self._lineage, self._parents = state["particles.parents"].copy()
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
