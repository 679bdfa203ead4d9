"""DP-SLAM's observations and ancestry tree, as arrays and what kernels do with them.

A. Eliazar and R. Parr, DP-SLAM, IJCAI 2003, section 4; DP-SLAM 2.0, ICRA 2004, section III. See
`distributed_map` for what they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int8, Int16, Int32, Int64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.tiles import NONE, TILE

TILE_SQUARES = TILE * TILE
CHUNK = 62
"""Squares in a chunk of a node's list."""
SIZES = 14
"""A block has room for 2 observations, 4, … and so on, in so many sizes."""


class MapArrays(NamedTuple):
    """The one map: kernels write to these."""

    tiles: Int32[np.ndarray, "rows columns"]
    """The tile of each square of `TILE` by `TILE` grid squares; `NONE` where none was seen."""
    corner: Int64[np.ndarray, "2"]
    """Row and column of `tiles[0, 0]`, counted in tiles from the map's origin."""
    tile_uses: Int32[np.ndarray, "tiles"]
    """How many squares of each tile have observations."""
    free_tiles: Int32[np.ndarray, "tiles"]
    """The free tiles: the first so many of this stack as `free_counts[SIZES]` says."""
    first: Int32[np.ndarray, "squares"]
    """Where the block of a square begins; `NONE` where it has no observations."""
    counts: Int16[np.ndarray, "squares"]
    """How many observations a square has…"""
    size: Int8[np.ndarray, "squares"]
    """…and for how many its block has room: 2 to the power of this and one."""
    slot: Int32[np.ndarray, "squares"]
    """Row of the square in the local map (see `LocalMap`); 0 for none, negative where the square is
    empty for every particle."""
    owner: Int16[np.ndarray, "observations"]
    """The node of the ancestry tree that made each observation."""
    beams: Float32[np.ndarray, "observations 2"]
    """How many beams have stopped in the square, and how far beams have gone through it (m)."""
    chain: Int32[np.ndarray, "blocks"]
    """The next free block of the same size, by half the place where a block begins."""
    free_blocks: Int32[np.ndarray, "sizes"]
    """The first free block of each size; `NONE` for none."""
    free_counts: Int64[np.ndarray, "counts"]
    """How many blocks of each size are free; then how many tiles are; then how many chunks."""
    used: Int64[np.ndarray, "2"]
    """All blocks lie before this place; how many observations there are."""


class TreeArrays(NamedTuple):
    """The ancestry tree: kernels write to these."""

    parent: Int16[np.ndarray, "nodes"]
    """The parent of each node; `NONE` of the root, and of what is no node."""
    children: Int16[np.ndarray, "nodes"]
    """How many children each node has; `NONE` where it is no node."""
    order: Int16[np.ndarray, "nodes"]
    """The nodes, parents before their children, as `order_nodes` left them."""
    chunk: Int32[np.ndarray, "nodes"]
    """The first chunk of the list of squares that each node observed; `NONE` for none."""
    chunks: Int32[np.ndarray, "chunks 64"]
    """Chunks: the next one's number, how many squares this has, and they."""
    free_chunk: Int64[np.ndarray, "1"]
    """The first free chunk, which the others follow."""


class LocalMap(NamedTuple):
    """What every particle knows of the squares around it: DP-SLAM 2.0's local maps.

    A row of it is made when a square is first asked for at an update, and all are forgotten at its
    end. Row 0 is none.
    """

    beams: Float32[np.ndarray, "slots particles 2"]
    """Beams stopped and distance (m) in a square, as each particle knows it; 0 and 0 where it knows
    nothing."""
    squares: Int32[np.ndarray, "slots"]
    """Which square has each row."""
    rows: Int64[np.ndarray, "1"]
    """How many rows are in use, with row 0."""
    nodes: Int16[np.ndarray, "particles"]
    """The node of each particle; `NONE` of those that have no descendants."""
    found: Int32[np.ndarray, "nodes"]
    """Room for the observation of each node."""


def make_local_map(slots: int, particles: int) -> LocalMap:
    """An empty local map of so many rows."""
    return LocalMap(
        # Not filled: memory is taken as rows are made.
        beams=np.empty((slots, particles, 2), np.float32),
        squares=np.empty(slots, np.int32),
        rows=np.ones(1, np.int64),
        nodes=np.full(particles, NONE, np.int16),
        found=np.empty(2 * particles, np.int32),
    )


@kernel()
def tile_at(arrays: MapArrays, tile_row: int, tile_column: int) -> int:
    """The tile at a place counted in tiles from the map's origin; `NONE` where none is made."""
    row, column = tile_row - arrays.corner[0], tile_column - arrays.corner[1]
    if 0 <= row < arrays.tiles.shape[0] and 0 <= column < arrays.tiles.shape[1]:
        return int(arrays.tiles[row, column])
    return NONE


@kernel()
def made_square_at(arrays: MapArrays, row: int, column: int) -> int:
    """The number of a square, whose tile is made if need be; there must be a free one."""
    tile_row, tile_column = (row >> 5) - arrays.corner[0], (column >> 5) - arrays.corner[1]
    tile = arrays.tiles[tile_row, tile_column]
    if tile == NONE:
        arrays.free_counts[SIZES] -= 1
        tile = arrays.free_tiles[arrays.free_counts[SIZES]]
        arrays.tiles[tile_row, tile_column] = tile
    return int(tile * TILE_SQUARES + (row & 31) * TILE + (column & 31))


@kernel()
def release_empty_tiles(arrays: MapArrays) -> None:
    """Give back the tiles in which no square has an observation."""
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

    There must be room for a block of twice the size, and for a chunk.
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
    _list_square(arrays, tree, node, square)


@kernel()
def own_observation(arrays: MapArrays, square: int, node: int) -> int:
    """Where the observation is that a node itself made of a square; `NONE` if it made none."""
    first = arrays.first[square]
    for at in range(first, first + arrays.counts[square]):
        if arrays.owner[at] == node:
            return at
    return NONE


@kernel()
def remove_observations(arrays: MapArrays, square: int, is_removed: np.ndarray) -> None:
    """Take the observations of some nodes out of a square; the others keep their order.

    Args:
        arrays: The map.
        square: The square.
        is_removed: Which nodes (nodes,).
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
    # A block of which three quarters are empty is left for a smaller one, if there is room.
    size = arrays.size[square]
    if 4 * kept <= 2 << size:
        while size > 0 and kept <= 1 << size:
            size -= 1
        has_room = arrays.used[0] + (2 << size) <= len(arrays.owner)
        if arrays.free_blocks[size] != NONE or has_room:
            arrays.first[square] = _move_block(arrays, square, size)


@kernel()
def _move_block(arrays: MapArrays, square: int, size: int) -> int:
    """Give a square a block of another size; return where it begins."""
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
def _list_square(arrays: MapArrays, tree: TreeArrays, node: int, square: int) -> None:
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
def _release_chunk(arrays: MapArrays, tree: TreeArrays, chunk: int) -> int:
    """Give a chunk back; return the one after it in its list."""
    after = tree.chunks[chunk, 0]
    tree.chunks[chunk, 0] = tree.free_chunk[0]
    tree.free_chunk[0] = chunk
    arrays.free_counts[SIZES + 1] += 1
    return int(after)


# ---- The ancestry tree ----------------------------------------------------------------------


@kernel()
def prune(
    arrays: MapArrays,
    tree: TreeArrays,
    nodes: np.ndarray,
    descendants: np.ndarray,
    is_removed: np.ndarray,
) -> None:
    """Make the tree minimal again, once it is known which particles have descendants.

    IJCAI 2003, section 4.2. The descendants themselves come into it by `add_node`.

    Args:
        arrays: The map.
        tree: The tree.
        nodes: The node of each particle (particles,); `NONE` afterwards of those without
            descendants.
        descendants: How many each has (particles,).
        is_removed: Room for a mark for each node (nodes,).
    """
    for k in range(len(nodes)):
        tree.children[nodes[k]] = descendants[k]
    _remove_dead(arrays, tree, nodes, is_removed)
    _merge_only_children(arrays, tree, nodes, is_removed)


@kernel()
def _remove_dead(
    arrays: MapArrays, tree: TreeArrays, nodes: np.ndarray, is_removed: np.ndarray
) -> None:
    """Take out the particles that have no descendants, and of their ancestors those without any."""
    is_removed[:] = 0
    for k in range(len(nodes)):
        node = nodes[k]
        if tree.children[node] > 0:
            continue
        nodes[k] = NONE
        while node != NONE and tree.children[node] == 0:
            is_removed[node] = 1
            node = tree.parent[node]
            if node != NONE:
                tree.children[node] -= 1
    for node in range(len(is_removed)):
        if is_removed[node]:
            _remove_node(arrays, tree, node, is_removed)


@kernel()
def _merge_only_children(
    arrays: MapArrays, tree: TreeArrays, nodes: np.ndarray, is_removed: np.ndarray
) -> None:
    """Make each node that is its parent's only child one with it.

    It is the parent that stays, as the parent has observed more squares. Whether a node is an only
    child does not change when its parent becomes one with the grandparent, so that each node is
    looked at once.
    """
    for node in range(len(tree.parent)):
        parent = tree.parent[node]
        if parent == NONE or tree.children[parent] != 1:
            continue
        _merge_into_parent(arrays, tree, node, is_removed)
        for k in range(len(nodes)):
            if nodes[k] == node:
                nodes[k] = parent


@kernel()
def add_node(tree: TreeArrays, parent: int) -> int:
    """A descendant of a particle comes into the tree; returns its node.

    A particle's only descendant takes over its node, as the two would become one at once.
    """
    if tree.children[parent] == 1:
        tree.children[parent] = 0
        return parent
    node = 0
    while tree.children[node] != NONE:
        node += 1
    tree.parent[node] = parent
    tree.children[node] = 0
    return node


@kernel()
def order_nodes(tree: TreeArrays) -> int:
    """Fill in `order`; return how many nodes there are."""
    count = 0
    for node in range(len(tree.parent)):
        if tree.children[node] != NONE and tree.parent[node] == NONE:
            tree.order[0] = node
            count = 1
    done = 0
    while done < count:
        for node in range(len(tree.parent)):
            if tree.parent[node] == tree.order[done]:
                tree.order[count] = node
                count += 1
        done += 1
    return count


@kernel()
def _remove_node(arrays: MapArrays, tree: TreeArrays, node: int, is_removed: np.ndarray) -> None:
    """Take a node out, and the observations of all that are removed from the squares it saw."""
    chunk = tree.chunk[node]
    while chunk != NONE:
        for k in range(tree.chunks[chunk, 1]):
            square = tree.chunks[chunk, 2 + k]
            # Others that are removed may have seen the square as well, and done it already.
            if arrays.first[square] != NONE:
                remove_observations(arrays, square, is_removed)
        chunk = _release_chunk(arrays, tree, chunk)
    tree.chunk[node] = NONE
    tree.parent[node] = NONE
    tree.children[node] = NONE


@kernel()
def _merge_into_parent(
    arrays: MapArrays, tree: TreeArrays, node: int, is_removed: np.ndarray
) -> None:
    """A node becomes one with its parent: what it observed replaces what the parent had."""
    parent = tree.parent[node]
    is_removed[:] = 0
    is_removed[node] = 1
    chunk = tree.chunk[node]
    while chunk != NONE:
        for k in range(tree.chunks[chunk, 1]):
            square = tree.chunks[chunk, 2 + k]
            own = own_observation(arrays, square, node)
            theirs = own_observation(arrays, square, parent)
            if theirs == NONE:
                arrays.owner[own] = parent
                _list_square(arrays, tree, parent, square)
            else:
                arrays.beams[theirs, 0] = arrays.beams[own, 0]
                arrays.beams[theirs, 1] = arrays.beams[own, 1]
                remove_observations(arrays, square, is_removed)
        chunk = _release_chunk(arrays, tree, chunk)
    for other in range(len(tree.parent)):
        if tree.parent[other] == node:
            tree.parent[other] = parent
    tree.children[parent] = tree.children[node]
    tree.chunk[node] = NONE
    tree.parent[node] = NONE
    tree.children[node] = NONE


# ---- What a particle knows ------------------------------------------------------------------


@kernel()
def fill_local_map(
    arrays: MapArrays, tree: TreeArrays, local: LocalMap, nodes: int, square: int
) -> int:
    """Make the row of a square in the local map; return its slot (see `MapArrays.slot`).

    ICRA 2004, section III: what a node knows of a square is its own observation, or else what its
    parent knows, so that all particles' knowledge is found at once, in as many steps as there are
    nodes.

    Args:
        arrays: The map.
        tree: The tree, its nodes in order.
        local: The local map, with a row to spare.
        nodes: How many nodes there are.
        square: The square.
    """
    slot, found, first = local.rows[0], local.found, arrays.first[square]
    local.rows[0] += 1
    local.squares[slot] = square
    for k in range(nodes):
        found[tree.order[k]] = NONE
    for at in range(first, first + arrays.counts[square]):
        found[arrays.owner[at]] = at
    for k in range(1, nodes):
        node = tree.order[k]
        if found[node] == NONE:
            found[node] = found[tree.parent[node]]
    is_empty = True
    for particle in range(len(local.nodes)):
        node = local.nodes[particle]
        at = NONE if node == NONE else found[node]
        stopped = arrays.beams[at, 0] if at != NONE else np.float32(0.0)
        distance = arrays.beams[at, 1] if at != NONE else np.float32(0.0)
        local.beams[slot, particle, 0] = stopped
        local.beams[slot, particle, 1] = distance
        if node != NONE and (distance == 0.0 or stopped > 0.0):
            is_empty = False
    arrays.slot[square] = -slot if is_empty else slot
    return int(arrays.slot[square])


@kernel()
def clear_local_map(arrays: MapArrays, local: LocalMap) -> None:
    """Forget all rows of the local map."""
    for slot in range(1, local.rows[0]):
        arrays.slot[local.squares[slot]] = 0
    local.rows[0] = 1


@kernel()
def known_beams(
    arrays: MapArrays, is_ancestor: np.ndarray, beams: np.ndarray, low: np.ndarray
) -> None:
    """Lay out all that one particle knows, by walking up its ancestry at each square.

    Args:
        arrays: The map.
        is_ancestor: Which nodes are the particle's own or above it (nodes,).
        beams: Beams stopped and distance (m) of each square (rows, columns, 2), filled in; 0 and 0
            where the particle knows nothing.
        low: Row and column, in tiles, of the first square's tile in the index (2,).
    """
    for row in range(beams.shape[0]):
        for column in range(beams.shape[1]):
            beams[row, column] = 0.0
            tile = arrays.tiles[low[0] + (row >> 5), low[1] + (column >> 5)]
            if tile == NONE:
                continue
            square = tile * TILE_SQUARES + (row & 31) * TILE + (column & 31)
            first = arrays.first[square]
            # The newest observation first: that of the nearest ancestor.
            for at in range(first + arrays.counts[square] - 1, first - 1, -1):
                if is_ancestor[arrays.owner[at]]:
                    beams[row, column, 0] = arrays.beams[at, 0]
                    beams[row, column, 1] = arrays.beams[at, 1]
                    break


@kernel()
def count_known(arrays: MapArrays, particles_below: np.ndarray, is_above: np.ndarray) -> int:
    """How many squares all particles know, in sum.

    Args:
        arrays: The map.
        particles_below: How many particles each node is, or is above of (nodes,).
        is_above: Whether one node is above another (nodes, nodes).
    """
    known = 0
    for square in range(len(arrays.first)):
        first = arrays.first[square]
        for at in range(first, first + arrays.counts[square]):
            # Who comes from this node has been counted where one above it saw the square as well.
            is_counted = False
            for other in range(first, at):
                if is_above[arrays.owner[other], arrays.owner[at]]:
                    is_counted = True
            if not is_counted:
                known += particles_below[arrays.owner[at]]
    return int(known)
