"""The map of DP-SLAM: one grid for all particles, and the tree of their ancestry.

A. Eliazar and R. Parr, DP-SLAM: fast, robust simultaneous localization and mapping without
predetermined landmarks, IJCAI 2003, section 4; DP-SLAM 2.0, ICRA 2004, section III.

A square of the grid holds observations. Each belongs to the node of the ancestry tree that made it.
It holds the number of beams that stopped in the square and the distance that beams went through it,
summed over the node and its ancestors. What a particle knows of a square is the observation of its
nearest ancestor that has one. So no map is ever copied: a particle that is resampled twice becomes
a node with two children, which add their own observations.

The tree is kept minimal. A node without descendants among the particles is removed with its
observations. A node with a single child is merged with it. So a tree of P leaves has at most
2P - 1 nodes, and a square has at most that many observations, however long the robot drives.

All data are arrays. Squares are stored in tiles, which are made as the ground is seen. The
observations of a square are stored in one block, with room for 2, 4, 8… of them, oldest first:
those of a node come after those of its ancestors. A node lists its observed squares in chunks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64, Int16, Int64

from albot_core.geometry.types import Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import (
    Arrays,
    Field,
    Schema,
    Sizes,
    lead_out,
    refuse_unless,
)
from albot_core.mappers.slam.ancestry import count_known, known_beams, order_nodes
from albot_core.mappers.slam.observations import (
    CHUNK,
    SIZES,
    TILE_SQUARES,
    MapArrays,
    TreeArrays,
    add_observation,
    made_square_at,
)
from albot_core.mappers.slam.tiles import NONE, TILE, extend_index, fit_an_index
from albot_core.mappers.stored import Stored

_FAR = 1e12
"""Largest coordinate (m); farther ones are clipped, so that tiles can be counted."""
_SPARE_CHUNKS = 2
"""Largest number of extra chunks that are needed while two lists of squares are merged."""


def _check_tree(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the nodes are a tree."""
    parents, expected = state["tree.parents"], "a tree with one root"
    is_node = parents >= NONE
    is_right = (parents == NONE).sum() == 1 and is_node[parents[parents >= 0]].all()
    refuse_unless(is_right and lead_out(np.maximum(parents, NONE)), "tree.parents", expected)


def _check_observations(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless nodes observed squares, each once, and some in every tile."""
    counts, owners = state["map.counts"], state["map.owners"]
    is_filled = counts.any(axis=1).all()
    refuse_unless(is_filled, "map.counts", "an observation in every tile", "none in one")
    are_nodes = (state["tree.parents"][owners] >= NONE).all()
    refuse_unless(are_nodes, "map.owners", "nodes of the tree")
    squares = np.repeat(np.arange(counts.size), counts.ravel())
    is_right = len(np.unique(squares * sizes["nodes"] + owners)) == len(owners)
    refuse_unless(is_right, "map.owners", "each node once in a square", "one twice")
    refuse_unless((state["map.beams"][:, 1] > 0).all(), "map.beams", "positive distances")


class DistributedMap(Stored):
    """The one map of all particles, with their ancestry tree.

    Args:
        particles: Largest number of particles.
        cell: Side of a grid square (m).
    """

    SCHEMA = Schema(
        Field("tree.parents", "nodes", np.int16, at=None, least=NONE - 1, below="nodes"),
        Field("map.places", "tiles 2", int, at=None, once=True),
        Field(
            "map.counts", f"tiles {TILE_SQUARES}", np.int16, at=None, least=0, sums="observations"
        ),
        Field("map.owners", "observations", np.int16, at=None, least=0, below="nodes"),
        Field("map.beams", "observations 2", np.float32, at=None, least=0),
        rules=(fit_an_index("map.places"), _check_tree, _check_observations),
    )

    def __init__(self, particles: int, cell: float) -> None:
        self.cell = cell
        squares = np.full(0, NONE, np.int32)
        self.arrays = MapArrays(
            tiles=np.full((0, 0), NONE, np.int32),
            corner=np.zeros(2, np.int64),
            tile_uses=np.zeros(0, np.int32),
            free_tiles=np.zeros(0, np.int32),
            first=squares,
            counts=np.zeros(0, np.int16),
            size=np.zeros(0, np.int8),
            slot=np.zeros(0, np.int32),
            owner=np.zeros(0, np.int16),
            beams=np.zeros((0, 2), np.float32),
            chain=np.zeros(0, np.int32),
            free_blocks=np.full(SIZES, NONE, np.int32),
            free_counts=np.zeros(SIZES + 2, np.int64),
            used=np.zeros(2, np.int64),
        )
        nodes = 2 * particles
        self.tree = TreeArrays(
            parent=np.full(nodes, NONE, np.int16),
            children=np.full(nodes, NONE, np.int16),
            order=np.full(nodes, NONE, np.int16),
            chunk=np.full(nodes, NONE, np.int32),
            chunks=np.zeros((0, CHUNK + 2), np.int32),
            free_chunk=np.full(1, NONE, np.int64),
        )
        # The root, the ancestor of all particles.
        self.tree.children[0] = 0

    @property
    def observations(self) -> int:
        """Number of observations in the map."""
        return int(self.arrays.used[1])

    @property
    def squares(self) -> int:
        """Number of squares with observations."""
        return int(self.arrays.tile_uses.sum())

    @property
    def bytes(self) -> int:
        """Size of all arrays of the map and the tree (bytes)."""
        return sum(array.nbytes for arrays in (self.arrays, self.tree) for array in arrays)

    def check_ground(self, poses: Poses, radius: float) -> None:
        """Check that the map can be extended to this distance (m) around all poses.

        Raises:
            InputError: The index would have more than `MOST_TILES` entries.
        """
        low, high = self._tiles_around(poses, radius)
        extend_index(self.arrays.tiles, self.arrays.corner, low, high, TILE * self.cell)

    def reserve_ground(self, poses: Poses, radius: float) -> None:
        """Reserve tiles within this distance (m) of the poses.

        Raises:
            InputError: The index would have more than `MOST_TILES` entries.
        """
        self.reserve_tiles(*self._tiles_around(poses, radius))

    def _tiles_around(
        self, poses: Poses, radius: float
    ) -> tuple[Int64[np.ndarray, "2"], Int64[np.ndarray, "2"]]:
        """Return row and column of the first tile near the poses, and after the last one."""
        places = poses[:, 1::-1]
        low, high = places.min(axis=0) - radius, places.max(axis=0) + radius
        ends = np.clip((low, high), -_FAR, _FAR) / (TILE * self.cell)
        first, last = np.floor(ends).astype(np.int64)
        return first, last + 1

    def reserve_tiles(self, low: Int64[np.ndarray, "2"], high: Int64[np.ndarray, "2"]) -> None:
        """Reserve all tiles from `low` (row, column) to before `high`.

        Raises:
            InputError: The index would have more than `MOST_TILES` entries.
        """
        arrays = self.arrays
        side = TILE * self.cell
        index, corner = extend_index(arrays.tiles, arrays.corner, low, high, side)
        rows, columns = (slice(a, b) for a, b in zip(low - corner, high - corner, strict=True))
        free = int(arrays.free_counts[SIZES])
        missing = int(np.count_nonzero(index[rows, columns] == NONE)) - free
        if missing > 0:
            before, more = len(arrays.tile_uses), max(missing, len(arrays.tile_uses) // 2)
            free_tiles = _grown(arrays.free_tiles, more)
            # The lowest indices are used first.
            free_tiles[free : free + more] = np.arange(before + more - 1, before - 1, -1)
            arrays.free_counts[SIZES] += more
            squares = more * TILE_SQUARES
            arrays = arrays._replace(
                tile_uses=_grown(arrays.tile_uses, more),
                free_tiles=free_tiles,
                first=_grown(arrays.first, squares, NONE),
                counts=_grown(arrays.counts, squares),
                size=_grown(arrays.size, squares),
                slot=_grown(arrays.slot, squares),
            )
        self.arrays = arrays._replace(tiles=index, corner=corner)

    def reserve_observations(self, places: int, chunks: int) -> None:
        """Reserve places for observations after all blocks, and free chunks."""
        arrays, tree = self.arrays, self.tree
        missing = int(arrays.used[0]) + places - len(arrays.owner)
        if missing > 0:
            more = max(missing + missing % 2, len(arrays.owner) // 4 * 2)
            self.arrays = arrays._replace(
                owner=_grown(arrays.owner, more),
                beams=_grown(arrays.beams, more),
                chain=_grown(arrays.chain, more // 2),
            )
        missing = chunks + _SPARE_CHUNKS - int(arrays.free_counts[SIZES + 1])
        if missing > 0:
            before, more = len(tree.chunks), max(missing, len(tree.chunks) // 2)
            grown = _grown(tree.chunks, more)
            grown[before:, 0] = np.arange(before + 1, before + more + 1)
            grown[-1, 0] = tree.free_chunk[0]
            tree.free_chunk[0] = before
            arrays.free_counts[SIZES + 1] += more
            self.tree = tree._replace(chunks=grown)

    def known_by(
        self, node: int
    ) -> tuple[Float64[np.ndarray, "rows columns 2"], Int64[np.ndarray, "2"]]:
        """Return all that the particle of a node knows, as one array that covers all tiles.

        Returns:
            The array of `known_beams`; and row and column of its first square in the map.
        """
        index = self.arrays.tiles
        rows, columns = np.nonzero(index != NONE)
        if not len(rows):
            return np.zeros((0, 0, 2)), np.zeros(2, np.int64)
        low = np.array((rows.min(), columns.min()))
        high = np.array((rows.max(), columns.max())) + 1
        is_ancestor = np.zeros(len(self.tree.parent), np.uint8)
        while node != NONE:
            is_ancestor[node] = 1
            node = int(self.tree.parent[node])
        beams = np.empty((*((high - low) * TILE), 2))
        known_beams(self.arrays, is_ancestor, beams, low)
        return beams, (self.arrays.corner + low) * TILE

    def count_known(self, nodes: Int16[np.ndarray, "particles"]) -> int:
        """Return the number of known squares, summed over the particles at these nodes."""
        count = len(self.tree.parent)
        is_above, below = np.zeros((count, count), np.bool_), np.zeros(count, np.int64)
        for node in np.flatnonzero(self.tree.children != NONE).tolist():
            above = int(self.tree.parent[node])
            while above != NONE:
                is_above[above, node] = True
                above = int(self.tree.parent[above])
        for node in nodes.tolist():
            below[node] += 1
            below[is_above[:, node]] += 1
        return int(count_known(self.arrays, below, is_above))

    def _sizes(self) -> dict[str, Any]:
        return {"nodes": len(self.tree.parent)}

    def _stored(self) -> dict[str, np.ndarray]:
        # All observations, tile by tile.
        arrays, tree = self.arrays, self.tree
        known = np.argwhere(arrays.tiles != NONE)
        tiles = arrays.tiles[known[:, 0], known[:, 1]]
        owners = np.empty(self.observations, np.int16)
        beams = np.empty((self.observations, 2), np.float32)
        gather(arrays, tiles, owners, beams)
        return {
            # Neither the root nor an unused node has a parent; unused nodes are marked NONE - 1.
            "tree.parents": np.where(tree.children == NONE, NONE - 1, tree.parent),
            "map.places": known + arrays.corner,
            "map.counts": arrays.counts.reshape(-1, TILE_SQUARES)[tiles],
            "map.owners": owners,
            "map.beams": beams,
        }

    def _restored(self, state: Arrays) -> None:
        """Restore the map. It must be fresh."""
        tree, parents = self.tree, state["tree.parents"]
        is_node = parents >= NONE
        tree.parent[:] = np.maximum(parents, NONE)
        children = np.bincount(parents[parents >= 0], minlength=len(parents))
        tree.children[:] = np.where(is_node, children, NONE)
        order_nodes(tree)
        places, counts, owners = (state[f"map.{name}"] for name in ("places", "counts", "owners"))
        if not len(places):
            return
        low, high = places.min(axis=0), places.max(axis=0) + 1
        self.reserve_tiles(low, high)
        needed = np.ceil(np.log2(np.maximum(counts.astype(np.int64), 2))).astype(np.int64)
        # A block is doubled until it is large enough; its smaller predecessors remain free.
        chunks = len(owners) // CHUNK + len(tree.parent)
        self.reserve_observations(int((2 << needed).sum()), chunks)
        scatter(self.arrays, self.tree, places - low, counts, owners, state["map.beams"])


def _grown(array: np.ndarray, more: int, value: int = 0) -> np.ndarray:
    """Return a longer copy of an array; the new entries have this value."""
    tail = np.full((more, *array.shape[1:]), value, array.dtype)
    return np.concatenate((array, tail))


@kernel()
def gather(arrays: MapArrays, tiles: np.ndarray, owners: np.ndarray, beams: np.ndarray) -> None:
    """Copy the observations of some tiles, square by square (observations,)."""
    n = 0
    for tile in tiles:
        for square in range(tile * TILE_SQUARES, (tile + 1) * TILE_SQUARES):
            first = arrays.first[square]
            for at in range(first, first + arrays.counts[square]):
                owners[n] = arrays.owner[at]
                beams[n, 0], beams[n, 1] = arrays.beams[at, 0], arrays.beams[at, 1]
                n += 1


@kernel()
def scatter(
    arrays: MapArrays,
    tree: TreeArrays,
    places: np.ndarray,
    counts: np.ndarray,
    owners: np.ndarray,
    beams: np.ndarray,
) -> None:
    """Enter the observations that `gather` copied into an empty map with enough room."""
    n = 0
    for tile in range(len(places)):
        row, column = places[tile, 0] + arrays.corner[0], places[tile, 1] + arrays.corner[1]
        first = made_square_at(arrays, row * TILE, column * TILE)
        for k in range(TILE_SQUARES):
            for _ in range(counts[tile, k]):
                add_observation(arrays, tree, first + k, owners[n], beams[n, 0], beams[n, 1])
                n += 1
