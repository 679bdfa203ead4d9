"""DP-SLAM's ancestry tree, and what a particle knows through its ancestors: kernels on arrays.

A. Eliazar and R. Parr, DP-SLAM, IJCAI 2003, section 4; DP-SLAM 2.0, ICRA 2004, section III. See
`distributed_map` for an introduction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int16, Int32, Int64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.observations import (
    TILE_SQUARES,
    MapArrays,
    TreeArrays,
    list_square,
    own_observation,
    release_chunk,
    remove_observations,
)
from albot_core.mappers.slam.tiles import NONE, TILE


@kernel()
def prune(
    arrays: MapArrays,
    tree: TreeArrays,
    nodes: np.ndarray,
    descendants: np.ndarray,
    is_removed: np.ndarray,
) -> None:
    """Make the tree minimal again after resampling.

    IJCAI 2003, section 4.2. `add_node` then adds the descendants themselves.

    Args:
        arrays: The map.
        tree: The tree.
        nodes: The node of each particle (particles,); set to `NONE` for particles without
            descendants.
        descendants: Number of descendants of each particle (particles,).
        is_removed: Scratch buffer, one mark per node (nodes,).
    """
    for k in range(len(nodes)):
        tree.children[nodes[k]] = descendants[k]
    _remove_dead(arrays, tree, nodes, is_removed)
    _merge_only_children(arrays, tree, nodes, is_removed)


@kernel()
def _remove_dead(
    arrays: MapArrays, tree: TreeArrays, nodes: np.ndarray, is_removed: np.ndarray
) -> None:
    """Remove the nodes of particles without descendants, and of ancestors that become childless."""
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
    """Merge each only child with its parent.

    The parent stays, since it has observed more squares. Merging a parent with the grandparent does
    not change whether a node is an only child, so one pass over the nodes is enough.
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
    """Add a descendant of a particle to the tree; return its node.

    A particle's only descendant takes over its node, since the two would be merged at once.
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
    """Fill in `order`; return the number of nodes."""
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
    """Remove a node, and all removed nodes' observations from the squares that it observed."""
    chunk = tree.chunk[node]
    while chunk != NONE:
        for k in range(tree.chunks[chunk, 1]):
            square = tree.chunks[chunk, 2 + k]
            # The square may already be empty: another removed node may have observed it too.
            if arrays.first[square] != NONE:
                remove_observations(arrays, square, is_removed)
        chunk = release_chunk(arrays, tree, chunk)
    tree.chunk[node] = NONE
    tree.parent[node] = NONE
    tree.children[node] = NONE


@kernel()
def _merge_into_parent(
    arrays: MapArrays, tree: TreeArrays, node: int, is_removed: np.ndarray
) -> None:
    """Merge a node into its parent; the node's observations replace the parent's."""
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
                list_square(arrays, tree, parent, square)
            else:
                arrays.beams[theirs, 0] = arrays.beams[own, 0]
                arrays.beams[theirs, 1] = arrays.beams[own, 1]
                remove_observations(arrays, square, is_removed)
        chunk = release_chunk(arrays, tree, chunk)
    for other in range(len(tree.parent)):
        if tree.parent[other] == node:
            tree.parent[other] = parent
    tree.children[parent] = tree.children[node]
    tree.chunk[node] = NONE
    tree.parent[node] = NONE
    tree.children[node] = NONE


class ParticleMaps(NamedTuple):
    """What every particle knows of the squares around it: DP-SLAM 2.0's local maps.

    A row is filled when a square is first needed in an update. All rows are cleared at the end of
    the update. Row 0 is unused.
    """

    beams: Float32[np.ndarray, "slots particles 2"]
    """Number of beams stopped and distance travelled (m) in each square, per particle; 0 and 0 if
    the particle knows nothing."""
    squares: Int32[np.ndarray, "slots"]
    """The square of each row."""
    rows: Int64[np.ndarray, "1"]
    """Number of rows in use, including row 0."""
    nodes: Int16[np.ndarray, "particles"]
    """The node of each particle; `NONE` for particles without descendants."""
    found: Int32[np.ndarray, "nodes"]
    """Scratch buffer: the observation of each node."""


def make_particle_maps(slots: int, particles: int) -> ParticleMaps:
    """Return empty maps with this number of rows."""
    return ParticleMaps(
        # Left uninitialised, so that memory is only used once rows are filled.
        beams=np.empty((slots, particles, 2), np.float32),
        squares=np.empty(slots, np.int32),
        rows=np.ones(1, np.int64),
        nodes=np.full(particles, NONE, np.int16),
        found=np.empty(2 * particles, np.int32),
    )


@kernel()
def fill_particle_maps(
    arrays: MapArrays, tree: TreeArrays, maps: ParticleMaps, nodes: int, square: int
) -> int:
    """Fill a row of the maps for a square; return its slot (see `MapArrays.slot`).

    ICRA 2004, section III: a node knows a square by its own observation, or else by its parent's.
    One pass over the nodes therefore gives the knowledge of all particles.

    Args:
        arrays: The map.
        tree: The tree, with its nodes in order.
        maps: The particles' maps, with at least one free row.
        nodes: Number of nodes.
        square: The square.
    """
    slot, found, first = maps.rows[0], maps.found, arrays.first[square]
    maps.rows[0] += 1
    maps.squares[slot] = square
    for k in range(nodes):
        found[tree.order[k]] = NONE
    for at in range(first, first + arrays.counts[square]):
        found[arrays.owner[at]] = at
    for k in range(1, nodes):
        node = tree.order[k]
        if found[node] == NONE:
            found[node] = found[tree.parent[node]]
    is_empty = True
    for particle in range(len(maps.nodes)):
        node = maps.nodes[particle]
        at = NONE if node == NONE else found[node]
        stopped = arrays.beams[at, 0] if at != NONE else np.float32(0.0)
        distance = arrays.beams[at, 1] if at != NONE else np.float32(0.0)
        maps.beams[slot, particle, 0] = stopped
        maps.beams[slot, particle, 1] = distance
        if node != NONE and (distance == 0.0 or stopped > 0.0):
            is_empty = False
    arrays.slot[square] = -slot if is_empty else slot
    return int(arrays.slot[square])


@kernel()
def clear_particle_maps(arrays: MapArrays, maps: ParticleMaps) -> None:
    """Clear all rows of the maps."""
    for slot in range(1, maps.rows[0]):
        arrays.slot[maps.squares[slot]] = 0
    maps.rows[0] = 1


@kernel()
def known_beams(
    arrays: MapArrays, is_ancestor: np.ndarray, beams: np.ndarray, low: np.ndarray
) -> None:
    """Fill in all that one particle knows, by a search for its nearest ancestor at each square.

    Args:
        arrays: The map.
        is_ancestor: Whether each node is the particle's own or an ancestor (nodes,).
        beams: Number of beams stopped and distance (m) of each square (rows, columns, 2), filled
            in; 0 and 0 where the particle knows nothing.
        low: Row and column of the first square's tile in the index (2,).
    """
    for row in range(beams.shape[0]):
        for column in range(beams.shape[1]):
            beams[row, column] = 0.0
            tile = arrays.tiles[low[0] + (row >> 5), low[1] + (column >> 5)]
            if tile == NONE:
                continue
            square = tile * TILE_SQUARES + (row & 31) * TILE + (column & 31)
            first = arrays.first[square]
            # Newest observation first: it belongs to the nearest ancestor.
            for at in range(first + arrays.counts[square] - 1, first - 1, -1):
                if is_ancestor[arrays.owner[at]]:
                    beams[row, column, 0] = arrays.beams[at, 0]
                    beams[row, column, 1] = arrays.beams[at, 1]
                    break


@kernel()
def count_known(arrays: MapArrays, particles_below: np.ndarray, is_above: np.ndarray) -> int:
    """Return the number of squares that each particle knows, summed over the particles.

    Args:
        arrays: The map.
        particles_below: Number of particles at each node and below it (nodes,).
        is_above: Whether the first node is an ancestor of the second (nodes, nodes).
    """
    known = 0
    for square in range(len(arrays.first)):
        first = arrays.first[square]
        for at in range(first, first + arrays.counts[square]):
            # Particles below an ancestor that observed the square are already counted.
            is_counted = False
            for other in range(first, at):
                if is_above[arrays.owner[other], arrays.owner[at]]:
                    is_counted = True
            if not is_counted:
                known += particles_below[arrays.owner[at]]
    return int(known)
