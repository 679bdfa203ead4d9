"""DP-SLAM 2.0's model of the laser: squares that stop a beam with a probability.

A. Eliazar and R. Parr, DP-SLAM 2.0, ICRA 2004, section II. The opacity ρ of a square is how far
beams go in it, on average, until one stops: the distance that beams went through it divided by how
many stopped there. A beam that goes x through the square stops with probability 1 - exp(-x / ρ).
So a square that is half full, seen along its edge, or gone from where it was, is neither occupied
nor free. A measured range is likely where the beam is likely to stop near it: the probability of
stopping in each square along the beam, times that of the laser's error for a stop there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.ancestry import LocalMap, clear_local_map, fill_local_map
from albot_core.mappers.slam.observations import TILE_SQUARES, MapArrays, TreeArrays, tile_at
from albot_core.mappers.slam.tiles import NONE, TILE
from albot_core.sensing.reading import LaserScan

SLIVER = 1e-9
"""A beam that goes no farther through a square (m) has only touched its corner."""


class LaserModel(NamedTuple):
    """The model's numbers, as kernels take them (see `DpSlamConfig`)."""

    cell: float
    """Side of a square (m)."""
    variance: float
    """Variance of a range (m²)."""
    prior: float
    """Opacity of a square that was never seen (m)."""
    prior_distance: float
    """How far beams have gone through such a square, as it were (m)."""
    beyond: float
    """A beam is followed so far beyond the range that was measured (m)…"""
    reach: float
    """…but no farther than this (m)."""
    before_end: float
    """Where it is judged by its end alone, from so far before it (m)…"""
    after_end: float
    """…to so far after (m)."""
    floor: float
    """No beam is less likely than this."""
    cull: float
    """A sample is given up whose logarithm of the likelihood is so much below the best one's."""
    passes: int
    """In so many passes beams are looked at, every so many-th at once."""


class Beams(NamedTuple):
    """The beams of a scan that are used."""

    directions: Float64[np.ndarray, "beams 2"]
    """Unit vectors in the robot's frame."""
    lengths: Float64[np.ndarray, "beams"]
    """How far they went (m), no farther than the reach."""
    stopped: Bool[np.ndarray, "beams"]
    """Whether something stopped them there."""
    eye: Float64[np.ndarray, "2"]
    """Where the laser is in the robot's frame (m)."""


def used_beams(scan: LaserScan, most: int, reach: float) -> Beams:
    """The beams of a scan that are used: each, or as far apart as need be.

    A laser that says 0 has seen nothing, and says nothing of what it did not see.

    Args:
        scan: The scan.
        most: No more of its beams are used.
        reach: Ranges count no farther than this (m).
    """
    geometry = scan.geometry
    every = -(-geometry.beams // most)
    ranges, directions = scan.ranges[::every], geometry.directions[::every]
    is_used = ranges > 0
    ranges = ranges[is_used]
    return Beams(
        directions=np.ascontiguousarray(directions[is_used]),
        lengths=np.minimum(ranges, reach),
        stopped=ranges < min(reach, geometry.max_range),
        eye=np.array(geometry.mount[:2]),
    )


@kernel()
def start_walk(
    ray: tuple[float, float, float, float], at: float, cell: float
) -> tuple[int, int, int, int, float, float, float, float]:
    """Begin to walk along a beam from square to square (J. Amanatides, A. Woo, Eurographics 1987).

    Args:
        ray: x, y of the laser in the map (m); x, y of the beam's unit vector.
        at: How far from the laser the walk begins (m).
        cell: Side of a square (m).

    Returns:
        Column and row of the first square; by how much they change; how far it is between lines
        of the grid, across and up (m); how far from the laser the next ones are (m).
    """
    x0, y0, ux, uy = ray
    x, y = x0 + at * ux, y0 + at * uy
    column, row = math.floor(x / cell), math.floor(y / cell)
    delta_x = abs(cell / ux) if ux != 0.0 else math.inf
    delta_y = abs(cell / uy) if uy != 0.0 else math.inf
    next_x = at + ((column + (ux > 0.0)) * cell - x) / ux if ux != 0.0 else math.inf
    next_y = at + ((row + (uy > 0.0)) * cell - y) / uy if uy != 0.0 else math.inf
    across, up = (1 if ux > 0.0 else -1), (1 if uy > 0.0 else -1)
    return column, row, across, up, delta_x, delta_y, next_x, next_y


@kernel()
def _density(
    arrays: MapArrays,
    tree: TreeArrays,
    local: LocalMap,
    nodes: int,
    particle: int,
    tile: int,
    row: int,
    column: int,
    prior: float,
) -> float:
    """1 / ρ: how many beams stop in a square, for each metre that they go through it.

    So that an empty square needs no infinity.
    """
    if tile == NONE:
        return 1.0 / prior
    square = tile * TILE_SQUARES + (row & 31) * TILE + (column & 31)
    slot = arrays.slot[square]
    if slot == 0 and arrays.first[square] != NONE:
        slot = fill_local_map(arrays, tree, local, nodes, square)
    if slot < 0:
        return 0.0
    stopped, distance = local.beams[slot, particle, 0], local.beams[slot, particle, 1]
    return stopped / distance if slot > 0 and distance > 0.0 else 1.0 / prior


@kernel()
def beam_likelihood(
    arrays: MapArrays,
    tree: TreeArrays,
    local: LocalMap,
    nodes: int,
    particle: int,
    ray: tuple[float, float, float, float],
    section: tuple[float, float],
    measured: float,
    is_stopped: bool,
    model: LaserModel,
) -> float:
    """How likely a beam is by what a particle knows.

    Args:
        arrays: The map.
        tree: The tree, in order.
        local: The local map.
        nodes: How many nodes there are.
        particle: Whose map counts.
        ray: x, y of the laser in the map (m); x, y of the beam's unit vector.
        section: From where to where the beam is followed, from the laser (m).
        measured: The measured range (m).
        is_stopped: Whether something stopped it there.
        model: The model's numbers.
    """
    at, end = section
    column, row, across, up, delta_x, delta_y, next_x, next_y = start_walk(ray, at, model.cell)
    scale = -0.5 / model.variance
    # The probability that the beam comes so far is exp(-depth). It is worked out from where on a
    # stop may be taken for the measured range: those that are farther before it count for nothing.
    depth, passed, likelihood = 0.0, -1.0, 0.0
    tile_row, tile_column, tile = row >> 5, column >> 5, tile_at(arrays, row >> 5, column >> 5)
    while at < end:
        if row >> 5 != tile_row or column >> 5 != tile_column:
            tile_row, tile_column = row >> 5, column >> 5
            tile = tile_at(arrays, tile_row, tile_column)
        density = _density(arrays, tree, local, nodes, particle, tile, row, column, model.prior)
        if next_x < next_y:
            leave, next_x, column = next_x, next_x + delta_x, column + across
        else:
            leave, next_y, row = next_y, next_y + delta_y, row + up
        leave = min(leave, end)
        # Most squares are empty for everyone.
        if density > 0.0 and leave - at > SLIVER:
            # The source takes the far side of the square for the place of the stop; it is as
            # likely to be anywhere in it.
            off = 0.5 * (at + leave) - measured
            if off > -model.beyond:
                before = math.exp(-depth) if passed < 0.0 else passed
                passed = math.exp(-depth - density * (leave - at))
                likelihood += (before - passed) * math.exp(scale * off * off)
            depth += density * (leave - at)
        at = leave
    if passed < 0.0:
        passed = math.exp(-depth)
    if not is_stopped:
        return likelihood + passed
    # Something has stopped it: the probability of all stops is 1.
    return likelihood / (1.0 - passed) if passed < 1.0 else 0.0


@kernel()
def weigh_samples(
    arrays: MapArrays,
    tree: TreeArrays,
    local: LocalMap,
    nodes: int,
    samples: np.ndarray,
    parents: np.ndarray,
    beams: Beams,
    model: LaserModel,
    logs: np.ndarray,
) -> None:
    """How likely a scan is from each sample's pose, by the map of its parent.

    First all are judged by where the beams end. Those that have a chance are then judged by the
    whole of them. Either is done in passes over some of the beams, after each of which samples
    are given up that are much less likely than the best.

    Args:
        arrays: The map.
        tree: The tree, in order.
        local: The local map.
        nodes: How many nodes there are.
        samples: The samples' poses (samples, 3).
        parents: The particle that each comes from (samples,).
        beams: The scan.
        model: The model's numbers.
        logs: The logarithms of the likelihoods (samples,), filled in; -inf where given up.
    """
    reserve = slots_needed(len(beams.lengths), model)
    logs[:] = 0.0
    for phase in range(2):
        least = -1e300
        for first in range(model.passes):
            best = -math.inf
            for i in range(len(samples)):
                if logs[i] < least:
                    logs[i] = -math.inf
                    continue
                if local.rows[0] + reserve > len(local.squares):
                    clear_local_map(arrays, local)
                logs[i] += _log_likelihood(
                    arrays, tree, local, nodes, parents[i], samples[i], beams, model, first, phase
                )
                best = max(best, logs[i])
            least = best - model.cull
        if phase == 0:
            for i in range(len(samples)):
                logs[i] = 0.0 if logs[i] >= least else -math.inf


@kernel()
def _log_likelihood(
    arrays: MapArrays,
    tree: TreeArrays,
    local: LocalMap,
    nodes: int,
    particle: int,
    pose: np.ndarray,
    beams: Beams,
    model: LaserModel,
    first: int,
    phase: int,
) -> float:
    """Logarithm of the likelihood of one pass's beams; in phase 0, of their ends alone."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x = pose[0] + cos * beams.eye[0] - sin * beams.eye[1]
    y = pose[1] + sin * beams.eye[0] + cos * beams.eye[1]
    total = 0.0
    for k in range(first, len(beams.lengths), model.passes):
        measured, stopped = beams.lengths[k], beams.stopped[k]
        begin, end = 0.0, min(measured + model.beyond, model.reach)
        if phase == 0:
            if not stopped:
                continue
            begin, end = max(measured - model.before_end, 0.0), measured + model.after_end
        ux = cos * beams.directions[k, 0] - sin * beams.directions[k, 1]
        uy = sin * beams.directions[k, 0] + cos * beams.directions[k, 1]
        ray, section = (x, y, ux, uy), (begin, end)
        likelihood = beam_likelihood(
            arrays, tree, local, nodes, particle, ray, section, measured, stopped, model
        )
        total += math.log(max(likelihood, model.floor))
    return total


@kernel()
def slots_needed(beams: int, model: LaserModel) -> int:
    """How many squares a scan can reach."""
    length = max(model.reach, model.after_end) + model.beyond + model.after_end
    return int(beams * (1.5 * length / model.cell + 4.0)) + 1
