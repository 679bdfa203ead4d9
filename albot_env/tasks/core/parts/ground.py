"""The parts that show the ground around the robot, and ways over it."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float

from albot_core.geometry.types import Ranges
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import TRAVEL
from albot_env.tasks.core.coverage_kernels import cut_patch, find_frontier
from albot_env.tasks.core.onward_kernels import pick_onward
from albot_env.tasks.core.parts.beliefs import observe_way, point_ahead
from albot_env.tasks.core.parts.part import Need, ObservationPart, Sources, with_laser
from albot_env.tasks.core.parts.scales import Scales, scale_ranges, unscale_ranges
from albot_env.tasks.core.wayfinding_kernels import POINT, pick_shortcut

# Shortcut


SHORTCUT = ObservationPart(
    name="shortcut",
    numbers="4",
    meaning=(
        "on request: the same for a shorter way home over ground that the robot has not seen to "
        "be blocked since the episode began, if the known way is at least 1.5 times as long "
        "(`WayfindingConfig`); without one 0, 0, -1, -1. For this the robot keeps an occupancy "
        "grid, from the laser and its believed pose, with any mapper"
    ),
    shape=with_laser(4),
    needs=frozenset((Need.WAY_HOME, Need.OCCUPANCY)),
    decode=point_ahead,
)


@kernel(arrays=True)
def fill_shortcut(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the point ahead on robot i's way home over ground not seen to be blocked."""
    state = sources.state
    point = pick_shortcut(sources.occupancy, i, sources.search, state.ways_home[i, TRAVEL])
    observe_way(state.beliefs[i], point, sources.scales.home, row)


# Path


PATH = ObservationPart(
    name="path",
    numbers="4",
    meaning=(
        "on request: the same for one way home instead of two: the shortcut if there is one, or if "
        "the known way turns out to be barred; else the shortest way, over ground not seen to be "
        "blocked, to the next point on the known way, or to home if there is no such point; "
        "without a way 0, 0, -1, -1"
    ),
    shape=with_laser(4),
    needs=frozenset((Need.WAY_HOME, Need.OCCUPANCY)),
    decode=point_ahead,
)


@kernel(arrays=True)
def fill_path(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the point ahead on the way home that robot i had better take."""
    observe_way(
        sources.state.beliefs[i], sources.occupancy.paths[i, POINT], sources.scales.home, row
    )


# Coverage


def _decode_coverage(
    numbers: Float[np.ndarray, "1 side side"], _: Scales
) -> Bool[np.ndarray, "side side"]:
    """Return which cells are covered; row 0 is farthest ahead, column 0 farthest to the left."""
    return np.asarray(numbers[0] > 0)


COVERAGE = ObservationPart(
    name="coverage",
    numbers="16 × 16",
    meaning=(
        "ground seen from within 2 m, in squares of 0.5 m around the robot, its heading up: 1 "
        "seen, -1 not"
    ),
    shape=lambda sizes: (1, sizes.patch, sizes.patch) if sizes.beams else (0,),
    needs=frozenset((Need.GROUND,)),
    decode=_decode_coverage,
)


@kernel()
def fill_coverage(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the patch of covered ground around robot i."""
    belief, scales = sources.state.beliefs[i], sources.scales
    turn = math.cos(belief[2]), math.sin(belief[2])
    cut_patch(sources.believed, i, belief, turn, scales.patch_cell, scales.patch_cells, row)


# Frontier


def _decode_frontier(numbers: Float[np.ndarray, "beams"], scales: Scales) -> Ranges:
    """Return the distance of uncovered ground along each beam (m); the longest for none."""
    return np.asarray(unscale_ranges(numbers, scales.laser))


FRONTIER = ObservationPart(
    name="frontier",
    numbers="one per beam",
    meaning=(
        "on request: distance of visible uncovered ground in the direction of each beam, on the "
        "laser's scale; -1 for none"
    ),
    shape=lambda sizes: (sizes.beams,),
    needs=frozenset((Need.GROUND,)),
    decode=_decode_frontier,
)


@kernel()
def fill_frontier(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in how far uncovered ground is in the directions of robot i's beams."""
    state, frontier = sources.state, sources.frontier
    find_frontier(sources.believed, i, state.beliefs[i], sources.sensor, state.ranges[i], frontier)
    scale_ranges(frontier, sources.scales.laser, row)


# Onward


ONWARD = ObservationPart(
    name="onward",
    numbers="4",
    meaning=(
        "on request: direction and distance of a point ahead on a way over ground seen to be free, "
        "and 1; without a way 0, 0, -1, -1. It leads to where a look around shows most uncovered "
        "ground for the length of the way (`WayfindingConfig`)"
    ),
    shape=with_laser(4),
    needs=frozenset((Need.GROUND, Need.OCCUPANCY)),
    decode=point_ahead,
)


@kernel(arrays=True)
def fill_onward(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the point ahead on robot i's way to uncovered ground."""
    point = pick_onward(sources.occupancy, i)
    observe_way(sources.state.beliefs[i], point, sources.scales.home, row)
