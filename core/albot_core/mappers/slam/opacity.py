"""DP-SLAM 2.0's laser model: squares that stop a beam with a probability.

A. Eliazar and R. Parr, DP-SLAM 2.0, ICRA 2004, section II. The opacity ρ of a square is the mean
distance that beams go in it until one stops: the total distance of beams through the square divided
by the number that stopped there. A beam that goes x through the square stops with probability
1 - exp(-x / ρ). So a square may be partly occupied: half filled, seen along an edge, or changed.
The likelihood of a measured range is a sum over the squares along the beam: the probability of
stopping in the square, times the likelihood of the laser's error for a stop there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.ancestry import ParticleMaps, clear_particle_maps, fill_particle_maps
from albot_core.mappers.slam.observations import TILE_SQUARES, MapArrays, TreeArrays, tile_at
from albot_core.mappers.slam.tiles import NONE, TILE
from albot_core.sensing.reading import LaserScan

SLIVER = 1e-9
"""Largest distance through a square at which a beam only touches its corner (m)."""


class LaserModel(NamedTuple):
    """The parameters of the laser model for kernels (see `DpSlamConfig`)."""

    cell: float
    """Side of a square (m)."""
    variance: float
    """Variance of a range (m²)."""
    prior: float
    """Opacity of an unobserved square (m)."""
    prior_distance: float
    """Distance of beams through a square that the prior is worth (m)."""
    beyond: float
    """Distance by which a beam is followed beyond the measured range (m)."""
    reach: float
    """Largest distance to which a beam is followed (m)."""
    before_end: float
    """Start of the section that is weighed first, before the beam's end (m)."""
    after_end: float
    """End of the section that is weighed first, after the beam's end (m)."""
    floor: float
    """Smallest likelihood of a beam."""
    cull: float
    """A sample is dropped if its log-likelihood is this far below the best one's."""
    passes: int
    """Number of passes over the beams; a pass uses every n-th beam, n being this number."""


class Beams(NamedTuple):
    """The beams of a scan that are used by the filter."""

    directions: Float64[np.ndarray, "beams 2"]
    """Unit vectors in the robot's frame."""
    lengths: Float64[np.ndarray, "beams"]
    """Measured ranges (m), limited to the reach."""
    stopped: Bool[np.ndarray, "beams"]
    """Whether each beam hit something at its length."""
    eye: Float64[np.ndarray, "2"]
    """The laser's position in the robot's frame (m)."""


def used_beams(scan: LaserScan, most: int, reach: float) -> Beams:
    """Return the beams of a scan that are used: all, or every n-th if there are too many.

    Beams with a range of 0 are dropped: they carry no information.

    Args:
        scan: The scan.
        most: Largest number of beams.
        reach: Largest range that is used (m).
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
    """Start a walk along a beam from square to square (J. Amanatides, A. Woo, Eurographics 1987).

    Args:
        ray: x, y of the laser in the map (m); x, y of the beam's unit vector.
        at: Distance from the laser at which the walk begins (m).
        cell: Side of a square (m).

    Returns:
        Column and row of the first square; their increments; distance between two grid lines
        along the beam, across and up (m); distance from the laser to the next of each (m).
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
    maps: ParticleMaps,
    nodes: int,
    particle: int,
    tile: int,
    row: int,
    column: int,
    prior: float,
) -> float:
    """Return 1 / ρ: the number of beams that stop in a square, per metre that they go through it.

    The inverse is used because the opacity of an empty square is infinite.
    """
    if tile == NONE:
        return 1.0 / prior
    square = tile * TILE_SQUARES + (row & 31) * TILE + (column & 31)
    slot = arrays.slot[square]
    if slot == 0 and arrays.first[square] != NONE:
        slot = fill_particle_maps(arrays, tree, maps, nodes, square)
    if slot < 0:
        return 0.0
    stopped, distance = maps.beams[slot, particle, 0], maps.beams[slot, particle, 1]
    return stopped / distance if slot > 0 and distance > 0.0 else 1.0 / prior


@kernel()
def beam_likelihood(
    arrays: MapArrays,
    tree: TreeArrays,
    maps: ParticleMaps,
    nodes: int,
    particle: int,
    ray: tuple[float, float, float, float],
    section: tuple[float, float],
    measured: float,
    is_stopped: bool,
    model: LaserModel,
) -> float:
    """Return the likelihood of a beam in a particle's map.

    Args:
        arrays: The map.
        tree: The tree, in order.
        maps: The particles' maps.
        nodes: Number of nodes.
        particle: The particle whose map is used.
        ray: x, y of the laser in the map (m); x, y of the beam's unit vector.
        section: Start and end of the section that is followed, as distances from the laser (m).
        measured: The measured range (m).
        is_stopped: Whether the beam hit something at this range.
        model: The laser model.
    """
    at, end = section
    column, row, across, up, delta_x, delta_y, next_x, next_y = start_walk(ray, at, model.cell)
    scale = -0.5 / model.variance
    # The beam gets this far with probability exp(-depth). Stops far before the measured range
    # count for nothing, so exp is only computed near it.
    depth, passed, likelihood = 0.0, -1.0, 0.0
    tile_row, tile_column, tile = row >> 5, column >> 5, tile_at(arrays, row >> 5, column >> 5)
    while at < end:
        if row >> 5 != tile_row or column >> 5 != tile_column:
            tile_row, tile_column = row >> 5, column >> 5
            tile = tile_at(arrays, tile_row, tile_column)
        density = _density(arrays, tree, maps, nodes, particle, tile, row, column, model.prior)
        if next_x < next_y:
            leave, next_x, column = next_x, next_x + delta_x, column + across
        else:
            leave, next_y, row = next_y, next_y + delta_y, row + up
        leave = min(leave, end)
        # Most squares are empty for every particle.
        if density > 0.0 and leave - at > SLIVER:
            # The source uses the far side of the square as the place of the stop; the middle is
            # used here, since the stop may be anywhere in the square.
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
    # The beam did stop, so the probabilities of all stops are normalised to a sum of 1.
    return likelihood / (1.0 - passed) if passed < 1.0 else 0.0


@kernel()
def weigh_samples(
    arrays: MapArrays,
    tree: TreeArrays,
    maps: ParticleMaps,
    nodes: int,
    samples: np.ndarray,
    parents: np.ndarray,
    beams: Beams,
    model: LaserModel,
    logs: np.ndarray,
) -> None:
    """Fill in the log-likelihood of a scan for each sample's pose, in its parent's map.

    In the first phase all samples are weighed by the beams' ends; in the second, those that remain
    are weighed by the whole beams. Each phase makes several passes over parts of the beams. After
    each pass, samples that are far less likely than the best one are dropped.

    Args:
        arrays: The map.
        tree: The tree, in order.
        maps: The particles' maps.
        nodes: Number of nodes.
        samples: The samples' poses (samples, 3).
        parents: The particle that each sample comes from (samples,).
        beams: The scan.
        model: The laser model.
        logs: The log-likelihoods (samples,), filled in; -inf for dropped samples.
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
                if maps.rows[0] + reserve > len(maps.squares):
                    clear_particle_maps(arrays, maps)
                logs[i] += _log_likelihood(
                    arrays, tree, maps, nodes, parents[i], samples[i], beams, model, first, phase
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
    maps: ParticleMaps,
    nodes: int,
    particle: int,
    pose: np.ndarray,
    beams: Beams,
    model: LaserModel,
    first: int,
    phase: int,
) -> float:
    """Return the log-likelihood of one pass's beams; in phase 0, of their ends only."""
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
            arrays, tree, maps, nodes, particle, ray, section, measured, stopped, model
        )
        total += math.log(max(likelihood, model.floor))
    return total


@kernel()
def slots_needed(beams: int, model: LaserModel) -> int:
    """Return an upper bound on the number of squares that a scan can touch."""
    length = max(model.reach, model.after_end) + model.beyond + model.after_end
    return int(beams * (1.5 * length / model.cell + 4.0)) + 1
