"""DP-SLAM's observations of grid squares, with the nodes that made them, as arrays.

A. Eliazar and R. Parr, DP-SLAM, IJCAI 2003, section 4; DP-SLAM 2.0, ICRA 2004, section III. See
`distributed_map` for an introduction. The observations of a square are stored in one block; a node
of the ancestry tree (`ancestry`) lists the squares that it observed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int8, Int16, Int32, Int64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.tiles import NONE, TILE

TILE_SQUARES = TILE * TILE
CHUNK = 62
"""Number of squares in a chunk of a node's list."""
SIZES = 14
"""Number of block sizes; blocks have room for 2, 4, 8, … observations."""


class MapArrays(NamedTuple):
    """The shared map, in arrays that kernels write to."""

    tiles: Int32[np.ndarray, "rows columns"]
    """The tile of each square of `TILE` by `TILE` grid squares; `NONE` where there is none."""
    corner: Int64[np.ndarray, "2"]
    """Row and column of `tiles[0, 0]`, counted in tiles from the map's origin."""
    tile_uses: Int32[np.ndarray, "tiles"]
    """Number of squares with observations, per tile."""
    free_tiles: Int32[np.ndarray, "tiles"]
    """Stack of the free tiles; its length is `free_counts[SIZES]`."""
    first: Int32[np.ndarray, "squares"]
    """Index of the first observation of each square; `NONE` if it has none."""
    counts: Int16[np.ndarray, "squares"]
    """Number of observations of each square."""
    size: Int8[np.ndarray, "squares"]
    """Size of each square's block: room for 2 to the power of (size + 1) observations."""
    slot: Int32[np.ndarray, "squares"]
    """Row of each square in the local maps (see `ParticleMaps`); 0 for none, negative if the square
    is empty for every particle."""
    owner: Int16[np.ndarray, "observations"]
    """The node of the ancestry tree that made each observation."""
    beams: Float32[np.ndarray, "observations 2"]
    """Number of beams that stopped in the square, and distance that beams went through it (m)."""
    chain: Int32[np.ndarray, "blocks"]
    """The next free block of the same size, indexed by half the index of a block's first place."""
    free_blocks: Int32[np.ndarray, "sizes"]
    """The first free block of each size; `NONE` for none."""
    free_counts: Int64[np.ndarray, "counts"]
    """Number of free blocks of each size; then of free tiles; then of free chunks."""
    used: Int64[np.ndarray, "2"]
    """End of the last block; number of observations."""


class TreeArrays(NamedTuple):
    """The ancestry tree, in arrays that kernels write to."""

    parent: Int16[np.ndarray, "nodes"]
    """The parent of each node; `NONE` for the root and for unused nodes."""
    children: Int16[np.ndarray, "nodes"]
    """Number of children of each node; `NONE` for unused nodes."""
    order: Int16[np.ndarray, "nodes"]
    """The nodes, parents before their children, as filled in by `order_nodes`."""
    chunk: Int32[np.ndarray, "nodes"]
    """The first chunk of each node's list of observed squares; `NONE` for none."""
    chunks: Int32[np.ndarray, "chunks 64"]
    """Each chunk: index of the next chunk, number of squares in this one, then the squares."""
    free_chunk: Int64[np.ndarray, "1"]
    """The first free chunk, which leads to the other free ones."""


@kernel()
def tile_at(arrays: MapArrays, tile_row: int, tile_column: int) -> int:
    """Return the tile at a row and column of tiles in the map; `NONE` if there is none."""
    row, column = tile_row - arrays.corner[0], tile_column - arrays.corner[1]
    if 0 <= row < arrays.tiles.shape[0] and 0 <= column < arrays.tiles.shape[1]:
        return int(arrays.tiles[row, column])
    return NONE


@kernel()
def made_square_at(arrays: MapArrays, row: int, column: int) -> int:
    """Return the index of a square; make its tile if necessary, from the free ones."""
    tile_row, tile_column = (row >> 5) - arrays.corner[0], (column >> 5) - arrays.corner[1]
    tile = arrays.tiles[tile_row, tile_column]
    if tile == NONE:
        arrays.free_counts[SIZES] -= 1
        tile = arrays.free_tiles[arrays.free_counts[SIZES]]
        arrays.tiles[tile_row, tile_column] = tile
    return int(tile * TILE_SQUARES + (row & 31) * TILE + (column & 31))


@kernel()
def release_empty_tiles(arrays: MapArrays) -> None:
    """Release the tiles in which no square has an observation."""
    for row in range(arrays.tiles.shape[0]):
        for column in range(arrays.tiles.shape[1]):
            tile = arrays.tiles[row, column]
            if tile != NONE and arrays.tile_uses[tile] == 0:
                arrays.tiles[row, column] = NONE
                arrays.free_tiles[arrays.free_counts[SIZES]] = tile
                arrays.free_counts[SIZES] += 1


# ---- Observations of squares ----------------------------------------------------------------


@kernel()
def add_observation(
    arrays: MapArrays, tree: TreeArrays, square: int, node: int, stopped: float, distance: float
) -> None:
    """Add a node's first observation of a square, after those of all its ancestors.

    There must be room for a block of twice the size, and a free chunk.
    """
    first, count = arrays.first[square], arrays.counts[square]
    if first == NONE:
        arrays.first[square] = first = _take_block(arrays, 0)
        arrays.size[square] = 0
        arrays.tile_uses[square // TILE_SQUARES] += 1
    elif count == 2 << arrays.size[square]:
        arrays.first[square] = first = _move_block(arrays, square, arrays.size[square] + 1)
    arrays.owner[first + count] = node
    arrays.beams[first + count, 0] = stopped
    arrays.beams[first + count, 1] = distance
    arrays.counts[square] += 1
    arrays.used[1] += 1
    list_square(arrays, tree, node, square)


@kernel()
def own_observation(arrays: MapArrays, square: int, node: int) -> int:
    """Return the index of a node's own observation of a square; `NONE` if it made none."""
    first = arrays.first[square]
    for at in range(first, first + arrays.counts[square]):
        if arrays.owner[at] == node:
            return at
    return NONE


@kernel()
def remove_observations(arrays: MapArrays, square: int, is_removed: np.ndarray) -> None:
    """Remove the observations of some nodes from a square. The others keep their order.

    Args:
        arrays: The map.
        square: The square.
        is_removed: Whether each node's observations are removed (nodes,).
    """
    first, count = arrays.first[square], arrays.counts[square]
    kept = 0
    for at in range(first, first + count):
        if is_removed[arrays.owner[at]]:
            continue
        arrays.owner[first + kept] = arrays.owner[at]
        arrays.beams[first + kept, 0] = arrays.beams[at, 0]
        arrays.beams[first + kept, 1] = arrays.beams[at, 1]
        kept += 1
    if kept == count:
        return
    arrays.used[1] -= count - kept
    arrays.counts[square] = kept
    if kept == 0:
        _release_block(arrays, first, arrays.size[square])
        arrays.first[square] = NONE
        arrays.tile_uses[square // TILE_SQUARES] -= 1
        return
    # A block that is three quarters empty is replaced by a smaller one, if there is room.
    size = arrays.size[square]
    if 4 * kept <= 2 << size:
        while size > 0 and kept <= 1 << size:
            size -= 1
        has_room = arrays.used[0] + (2 << size) <= len(arrays.owner)
        if arrays.free_blocks[size] != NONE or has_room:
            arrays.first[square] = _move_block(arrays, square, size)


@kernel()
def _move_block(arrays: MapArrays, square: int, size: int) -> int:
    """Move a square's observations to a block of another size; return the block's index."""
    before, block = arrays.first[square], _take_block(arrays, size)
    for k in range(arrays.counts[square]):
        arrays.owner[block + k] = arrays.owner[before + k]
        arrays.beams[block + k, 0] = arrays.beams[before + k, 0]
        arrays.beams[block + k, 1] = arrays.beams[before + k, 1]
    _release_block(arrays, before, arrays.size[square])
    arrays.size[square] = size
    return block


@kernel()
def _take_block(arrays: MapArrays, size: int) -> int:
    block = arrays.free_blocks[size]
    if block == NONE:
        block = arrays.used[0]
        arrays.used[0] += 2 << size
    else:
        arrays.free_blocks[size] = arrays.chain[block >> 1]
        arrays.free_counts[size] -= 1
    return int(block)


@kernel()
def _release_block(arrays: MapArrays, block: int, size: int) -> None:
    arrays.chain[block >> 1] = arrays.free_blocks[size]
    arrays.free_blocks[size] = block
    arrays.free_counts[size] += 1


# ---- The lists of squares that nodes observed -----------------------------------------------


@kernel()
def list_square(arrays: MapArrays, tree: TreeArrays, node: int, square: int) -> None:
    """Add a square to a node's list of observed squares. There must be a free chunk."""
    chunk = tree.chunk[node]
    if chunk == NONE or tree.chunks[chunk, 1] == CHUNK:
        free = tree.free_chunk[0]
        tree.free_chunk[0] = tree.chunks[free, 0]
        arrays.free_counts[SIZES + 1] -= 1
        tree.chunks[free, 0] = chunk
        tree.chunks[free, 1] = 0
        tree.chunk[node] = chunk = free
    tree.chunks[chunk, 2 + tree.chunks[chunk, 1]] = square
    tree.chunks[chunk, 1] += 1


@kernel()
def release_chunk(arrays: MapArrays, tree: TreeArrays, chunk: int) -> int:
    """Release a chunk; return the next one in its list."""
    after = tree.chunks[chunk, 0]
    tree.chunks[chunk, 0] = tree.free_chunk[0]
    tree.free_chunk[0] = chunk
    arrays.free_counts[SIZES + 1] += 1
    return int(after)
