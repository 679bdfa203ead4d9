"""Tiles of cells that grids share until one of them writes (copy on write).

The tiles of all grids of a pool lie in one array; a grid is an index of them. A forked grid shares
its tiles with the original until one of the two writes to them, so particles only use memory for
the tiles in which their maps differ. Pool and index are plain arrays, which kernels use directly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int32, Int64, UInt8

from albot_core.errors import InputError
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Rule, Sizes, refuse_unless

TILE_BITS = 5
TILE = 1 << TILE_BITS
"""Cells along each side of a tile."""
NONE = -1
"""Entry of an index without a tile: the ground is unknown."""
MOST_TILES = 1 << 17
"""Largest number of entries of an index: ground of 580 m by 580 m in cells of 5 cm. A larger map
is not a building, but the result of a lost robot."""


class PoolArrays(NamedTuple):
    """The tiles of all grids of a pool, in arrays that kernels write to."""

    cells: Float32[np.ndarray, "tiles 32 32"]
    """Log odds of the cells, by row (y) and column (x)."""
    uses: Int32[np.ndarray, "tiles"]
    """Number of grids that use each tile; 0 for a free tile."""
    free: Int32[np.ndarray, "tiles"]
    """Stack of the free tiles."""
    free_count: Int64[np.ndarray, "1"]
    """Number of free tiles: the length of the stack."""


class TilePool:
    """A pool of tiles, which several grids may share."""

    def __init__(self) -> None:
        self.arrays = PoolArrays(
            np.zeros((0, TILE, TILE), np.float32),
            np.zeros(0, np.int32),
            np.zeros(0, np.int32),
            np.zeros(1, np.int64),
        )
        self._marks = np.zeros(0, np.uint8)
        self._touched = np.empty(0, np.int32)

    def marks(self, half: int) -> tuple[UInt8[np.ndarray, "cells"], Int32[np.ndarray, "cells+1"]]:
        """Return the scratch buffers of `integrate_scan`, for cells within `half` of the laser.

        All grids use them in turn: buffers for each particle would be larger than the maps.
        """
        cells = (2 * half + 1) ** 2
        if len(self._marks) != cells:
            self._marks, self._touched = np.zeros(cells, np.uint8), np.empty(cells + 1, np.int32)
        return self._marks, self._touched

    @property
    def used(self) -> int:
        """Number of tiles in use, each counted once."""
        return len(self.arrays.uses) - int(self.arrays.free_count[0])

    def reserve(self, tiles: int) -> None:
        """Make sure that there are at least this many free tiles."""
        cells, uses, free, count = self.arrays
        missing = tiles - int(count[0])
        if missing <= 0:
            return
        before, more = len(uses), max(missing, len(uses) // 2)
        free = np.concatenate((free, np.zeros(more, np.int32)))
        # The lowest indices are used first.
        free[count[0] : count[0] + more] = np.arange(before + more - 1, before - 1, -1)
        self.arrays = PoolArrays(
            np.concatenate((cells, np.zeros((more, TILE, TILE), np.float32))),
            np.concatenate((uses, np.zeros(more, np.int32))),
            free,
            count + more,
        )


def tiles_around(
    x: float, y: float, reach: float, cell: float
) -> tuple[Int64[np.ndarray, "2"], Int64[np.ndarray, "2"]]:
    """Return row and column of the first tile around a point (m), and after the last one."""
    side = TILE * cell
    low = np.floor(np.array((y - reach, x - reach)) / side).astype(np.int64)
    high = np.floor(np.array((y + reach, x + reach)) / side).astype(np.int64) + 1
    return low, high


def extend_index(
    index: Int32[np.ndarray, "*grids rows columns"],
    corner: Int64[np.ndarray, "2"],
    low: Int64[np.ndarray, "2"],
    high: Int64[np.ndarray, "2"],
    side: float,
) -> tuple[Int32[np.ndarray, "*grids more_rows more_columns"], Int64[np.ndarray, "2"]]:
    """Return an index, or several, with room for the tiles from `low` to before `high`.

    Args:
        index: The tiles; axes before the last two count grids with equal shapes.
        corner: Row and column of the first entry, in tiles from the map's origin.
        low: Row and column of the first tile that needs room.
        high: Row and column after the last such tile.
        side: Side of a tile (m), for the error message.

    Returns:
        The index (unchanged if it has the room), and its corner.

    Raises:
        InputError: The index would have more than `MOST_TILES` entries.
    """
    if index.size:
        low = np.minimum(low, corner)
        high = np.maximum(high, corner + index.shape[-2:])
    # Python's own integers do not overflow.
    rows, columns = (int(end) - int(begin) for begin, end in zip(low, high, strict=True))
    if rows * columns > MOST_TILES:
        raise InputError(
            "occupancy grid",
            f"ground that fits into {MOST_TILES * side * side / 1e6:.2f} km²",
            f"{rows * side:.0f} m by {columns * side:.0f} m",
        )
    if (rows, columns) == index.shape[-2:]:
        return index, corner
    larger = np.full((*index.shape[:-2], rows, columns), NONE, np.int32)
    if index.size:
        (row, column), (height, width) = corner - low, index.shape[-2:]
        larger[..., row : row + height, column : column + width] = index
    return larger, low


def fit_an_index(name: str) -> Rule:
    """Return the rule that an index can hold all tiles at the places (row, column) of an array."""

    def rule(state: Arrays, sizes: Sizes) -> None:
        # Python's own integers do not overflow.
        rows, columns = (
            max(ends, default=0) - min(ends, default=0) for ends in state[name].T.tolist()
        )
        is_right = (rows + 1) * (columns + 1) <= MOST_TILES
        refuse_unless(is_right, name, f"{MOST_TILES} tiles at most", f"{rows + 1} by {columns + 1}")

    return rule


@kernel()
def take_tile(pool: PoolArrays) -> int:
    """Return a free tile, which then has one user. Its cells are uninitialised."""
    pool.free_count[0] -= 1
    tile = pool.free[pool.free_count[0]]
    pool.uses[tile] = 1
    return int(tile)


@kernel()
def writable_tile(pool: PoolArrays, index: np.ndarray, row: int, column: int) -> int:
    """Return the tile at a place of an index; make or copy it if the grid is not its only user.

    There must be a free tile.
    """
    tile = index[row, column]
    if tile != NONE and pool.uses[tile] == 1:
        return int(tile)
    own = take_tile(pool)
    for i in range(TILE):
        for j in range(TILE):
            pool.cells[own, i, j] = 0.0 if tile == NONE else pool.cells[tile, i, j]
    if tile != NONE:
        pool.uses[tile] -= 1
    index[row, column] = own
    return own


@kernel()
def release_tiles(pool: PoolArrays, index: np.ndarray) -> None:
    """Release all tiles of an index, and empty it."""
    for row in range(index.shape[0]):
        for column in range(index.shape[1]):
            tile = index[row, column]
            if tile == NONE:
                continue
            index[row, column] = NONE
            pool.uses[tile] -= 1
            if pool.uses[tile] == 0:
                pool.free[pool.free_count[0]] = tile
                pool.free_count[0] += 1


@kernel()
def log_odds_at(
    pool: PoolArrays, index: np.ndarray, corner: np.ndarray, row: int, column: int
) -> float:
    """Return the log odds of a cell by row and column in the map; 0 where nothing is known."""
    tile_row, tile_column = row // TILE - corner[0], column // TILE - corner[1]
    if not (0 <= tile_row < index.shape[0] and 0 <= tile_column < index.shape[1]):
        return 0.0
    tile = index[tile_row, tile_column]
    return 0.0 if tile == NONE else pool.cells[tile, row % TILE, column % TILE]
