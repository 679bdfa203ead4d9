"""Entry of a scan into DP-SLAM's map: observations of a node, at its particle's pose.

A. Eliazar and R. Parr, DP-SLAM 2.0, ICRA 2004: a beam adds its distance in each square that it
crosses, and a stop in the square where it ended (see `opacity`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.slam.ancestry import ParticleMaps, clear_particle_maps, fill_particle_maps
from albot_core.mappers.slam.observations import (
    CHUNK,
    SIZES,
    MapArrays,
    TreeArrays,
    add_observation,
    made_square_at,
    own_observation,
)
from albot_core.mappers.slam.opacity import SLIVER, Beams, LaserModel, slots_needed, start_walk
from albot_core.mappers.slam.tiles import NONE

_block_counts = scratch(SIZES, kind=types.int64)


@kernel()
def enter_scan(
    arrays: MapArrays,
    tree: TreeArrays,
    maps: ParticleMaps,
    nodes: int,
    particle: int,
    node: int,
    pose: np.ndarray,
    beams: Beams,
    model: LaserModel,
    seen: np.ndarray,
    touched: np.ndarray,
    lacking: np.ndarray,
) -> bool:
    """Enter a scan into the map, as a node's observations.

    Args:
        arrays: The map, with enough free tiles.
        tree: The tree, in order.
        maps: The particles' maps.
        nodes: Number of nodes.
        particle: The parent particle of the node, whose earlier knowledge is used.
        node: The node.
        pose: x, y, heading of the robot (3,).
        beams: The scan.
        model: The laser model.
        seen: Zeros for every row of the maps: beams stopped and distance (slots, 2); zeros
            again at the end.
        touched: Scratch buffer, one number per row.
        lacking: Number of places for observations and of free chunks needed (2,), filled in.

    Returns:
        Whether the scan was entered. If not, there was too little room, and nothing has changed.
    """
    if maps.rows[0] + slots_needed(len(beams.lengths), model) > len(maps.squares):
        clear_particle_maps(arrays, maps)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x0 = pose[0] + cos * beams.eye[0] - sin * beams.eye[1]
    y0 = pose[1] + sin * beams.eye[0] + cos * beams.eye[1]
    count = 0
    for k in range(len(beams.lengths)):
        ux = cos * beams.directions[k, 0] - sin * beams.directions[k, 1]
        uy = sin * beams.directions[k, 0] + cos * beams.directions[k, 1]
        at, end = 0.0, beams.lengths[k]
        walk = start_walk((x0, y0, ux, uy), at, model.cell)
        column, row, across, up, delta_x, delta_y, next_x, next_y = walk
        while at < end:
            leave = min(next_x, next_y, end)
            is_hit = leave == end and beams.stopped[k]
            if leave - at > SLIVER or is_hit:
                slot = _made_slot(arrays, tree, maps, nodes, row, column)
                if seen[slot, 1] == 0.0:
                    touched[count] = slot
                    count += 1
                seen[slot, 1] += max(leave - at, SLIVER)
                seen[slot, 0] += is_hit
            at = leave
            if next_x < next_y:
                column, next_x = column + across, next_x + delta_x
            else:
                row, next_y = row + up, next_y + delta_y
    is_entered = _has_room(arrays, maps, touched[:count], lacking)
    if is_entered:
        _add_seen(arrays, tree, maps, particle, node, seen, touched[:count], model.prior_distance)
    for k in range(count):
        seen[touched[k], 0] = seen[touched[k], 1] = 0.0
    return is_entered


@kernel()
def _made_slot(
    arrays: MapArrays, tree: TreeArrays, maps: ParticleMaps, nodes: int, row: int, column: int
) -> int:
    """Return a square's row in the maps; make the square's tile if necessary."""
    square = made_square_at(arrays, row, column)
    slot = arrays.slot[square]
    if slot == 0:
        slot = fill_particle_maps(arrays, tree, maps, nodes, square)
    return int(abs(slot))


@kernel()
def _add_seen(
    arrays: MapArrays,
    tree: TreeArrays,
    maps: ParticleMaps,
    particle: int,
    node: int,
    seen: np.ndarray,
    slots: np.ndarray,
    prior_distance: float,
) -> None:
    """Enter the node's observations: the particle's earlier knowledge plus what was seen."""
    # For most nodes this is the first scan.
    has_observed = tree.chunk[node] != NONE
    for slot in slots:
        stopped, distance = maps.beams[slot, particle, 0], maps.beams[slot, particle, 1]
        if distance == 0.0:
            # The prior of an unobserved square counts as some distance, but no stopped beam.
            distance = np.float32(prior_distance)
        square = maps.squares[slot]
        own = own_observation(arrays, square, node) if has_observed else NONE
        if own == NONE:
            add_observation(
                arrays, tree, square, node, stopped + seen[slot, 0], distance + seen[slot, 1]
            )
        else:
            arrays.beams[own, 0] = stopped + seen[slot, 0]
            arrays.beams[own, 1] = distance + seen[slot, 1]


@kernel()
def _has_room(
    arrays: MapArrays, maps: ParticleMaps, slots: np.ndarray, lacking: np.ndarray
) -> bool:
    """Return whether there is room for one more observation of each of these squares."""
    # Number of blocks of each size needed in addition to the free ones.
    blocks = _block_counts()
    for size in range(SIZES):
        blocks[size] = -arrays.free_counts[size]
    for k in range(len(slots)):
        square = maps.squares[slots[k]]
        if arrays.first[square] == NONE:
            blocks[0] += 1
        elif arrays.counts[square] == 2 << arrays.size[square]:
            blocks[arrays.size[square] + 1] += 1
    places = 0
    for size in range(SIZES):
        places += max(blocks[size], 0) * (2 << size)
    lacking[0], lacking[1] = places, len(slots) // CHUNK + 2
    has_places = arrays.used[0] + places <= len(arrays.owner)
    return bool(has_places and lacking[1] <= arrays.free_counts[SIZES + 1])
