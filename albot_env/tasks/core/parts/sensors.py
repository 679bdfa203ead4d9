"""The parts that come from the latest reading: laser, sonar, odometer and compass."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

from albot_core.geometry.types import Pose, Ranges
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.parts.part import ObservationPart, Sources
from albot_env.tasks.core.parts.scales import Scales, scale_ranges, unscale_ranges

Numbers = Float[np.ndarray, "numbers"]


# Laser


def _decode_laser(numbers: Numbers, scales: Scales) -> Ranges:
    """Return the ranges (m); the scale's longest for no return."""
    return np.asarray(unscale_ranges(numbers, scales.laser))


LASER = ObservationPart(
    name="laser",
    numbers="one per beam",
    meaning="range: 1 at 0 m, -1 at 30 m and beyond, logarithmic in between",
    shape=lambda sizes: (sizes.beams,),
    decode=_decode_laser,
)


@kernel()
def fill_laser(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in robot i's ranges, or the minimum of each sector."""
    seen = sources.state.ranges[i]
    if sources.scales.sectors:
        find_nearest(seen, sources.nearest)
        seen = sources.nearest
    scale_ranges(seen, sources.scales.laser, row)


@kernel()
def find_nearest(ranges: np.ndarray, nearest: np.ndarray) -> None:
    """Fill `nearest` with the minimum range of each of `len(nearest)` equal sectors."""
    beams, sectors = ranges.shape[0], nearest.shape[0]
    for k in range(sectors):
        first, last = k * beams // sectors, (k + 1) * beams // sectors
        shortest = ranges[first]
        for beam in range(first + 1, last):
            shortest = min(shortest, ranges[beam])
        nearest[k] = shortest


# Sonar


def _decode_sonar(numbers: Numbers, scales: Scales) -> Ranges:
    """Return the ranges (m); the scale's longest for no echo."""
    return np.asarray(unscale_ranges(numbers, scales.sonar))


SONAR = ObservationPart(
    name="sonar",
    numbers="one per sonar",
    meaning="the same up to 4 m",
    shape=lambda sizes: (sizes.sonars,),
    decode=_decode_sonar,
)


@kernel()
def fill_sonar(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the ranges of robot i's echoes."""
    scale_ranges(sources.state.echoes[i], sources.scales.sonar, row)


# Motion


def _decode_motion(numbers: Numbers, scales: Scales) -> Pose:
    """Return the robot's motion in the last step, by its odometer (m, m, rad)."""
    step = np.array((scales.step_length, scales.step_length, scales.step_turn))
    return np.asarray(numbers * step)


MOTION = ObservationPart(
    name="motion",
    numbers="3",
    meaning="the odometer's last step: forward, sideways, turn",
    shape=lambda _: (3,),
    decode=_decode_motion,
)


@kernel()
def fill_motion(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in robot i's last motion."""
    scales = sources.scales
    observe_motion(sources.state.motions[i], scales.step_length, scales.step_turn, row)


@kernel()
def observe_motion(motion: np.ndarray, length: float, turn: float, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part motion, in shares of a step's length (m) and turn (rad)."""
    for i in range(3):
        share = motion[i] / (length if i < 2 else turn)
        row[i] = min(max(share, -1.0), 1.0)


# Compass


def _decode_compass(numbers: Numbers, _: Scales) -> float:
    """Return the heading by the compass (rad)."""
    return math.atan2(float(numbers[1]), float(numbers[0]))


COMPASS = ObservationPart(
    name="compass",
    numbers="2",
    meaning="on request: the heading by the compass",
    shape=lambda sizes: (2 * sizes.compasses,),
    decode=_decode_compass,
)


@kernel()
def fill_compass(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the heading by robot i's compass."""
    heading = sources.state.compasses[i]
    row[0], row[1] = math.cos(heading), math.sin(heading)
