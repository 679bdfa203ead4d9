"""DP-SLAM's ancestry tree, and what a particle knows by its ancestors: kernels on arrays.

A. Eliazar and R. Parr, DP-SLAM, IJCAI 2003, section 4; DP-SLAM 2.0, ICRA 2004, section III. See
`distributed_map` for what they are.
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
        chunk = release_chunk(arrays, tree, chunk)
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
