"""The panorama: what a laser has seen all round, by directions of the compass.

Sahabot 2's camera looks all round at once. A laser of 180° does not, so what it saw is carried
along: the points are seen from where the robot is now, until it looks in their direction again.
With a laser that looks all round, nothing is carried along. This is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel
from albot_core.sensing.reading import LaserGeometry

DIRECTIONS = 360
"""Number of directions of a panorama; direction k is k degrees from the start's heading."""
UNSEEN = -1.0
"""Range in a direction that was not looked in."""
_SLACK = 5
"""How far apart, in directions, two panoramas may show the same thing near the nest."""
_SPACING = 2.0 * math.pi / DIRECTIONS


class Beams(NamedTuple):
    """The laser's beams, for compiled code."""

    number: int
    first: float
    """Bearing of the first beam (rad) from the robot's heading."""
    spacing: float
    """Angle between beams (rad)."""
    max_range: float
    """Ranges from here on mean no return (m)."""


def beams_of(laser: LaserGeometry) -> Beams:
    """Return the beams of a laser."""
    return Beams(
        laser.beams, laser.first_bearing + laser.mount[2], laser.spacing, float(laser.max_range)
    )


@kernel(nogil=True)
def carry_along(panorama: np.ndarray, x: float, y: float, carried: np.ndarray) -> None:
    """Fill `carried` with a panorama as it is seen from a place x, y (m) farther on.

    A direction in which no point lies then keeps its range, shortened by the way in that direction.
    """
    count = panorama.shape[0]
    for k in range(count):
        carried[k] = np.nan
    for k in range(count):
        if 0.0 <= panorama[k] < np.inf:
            away = panorama[k] * math.cos(k * _SPACING) - x
            aside = panorama[k] * math.sin(k * _SPACING) - y
            at = round(math.atan2(aside, away) / _SPACING) % count
            distance = math.sqrt(away * away + aside * aside)
            if not carried[at] <= distance:  # Also where nothing is yet.
                carried[at] = distance
    for k in range(count):
        if math.isnan(carried[k]):
            shorter = panorama[k] - x * math.cos(k * _SPACING) - y * math.sin(k * _SPACING)
            carried[k] = UNSEEN if panorama[k] == UNSEEN else max(shorter, 0.0)


@kernel(nogil=True)
def look(panorama: np.ndarray, heading: float, beams: Beams, ranges: np.ndarray) -> None:
    """Write a scan over those directions of a panorama in which it looks.

    Args:
        panorama: (DIRECTIONS,) float64: the ranges (m); written over.
        heading: The robot's heading since the start (rad).
        beams: The laser's beams.
        ranges: (beams,) float64: their ranges (m).
    """
    turn = 2.0 * math.pi
    for k in range(panorama.shape[0]):
        bearing = k * _SPACING - heading - beams.first
        bearing -= math.floor(bearing / turn) * turn
        beam = round(bearing / beams.spacing)
        if beam >= beams.number and turn - bearing <= 0.5 * beams.spacing:
            beam = 0  # Just before the first.
        if beam < beams.number:
            panorama[k] = ranges[beam] if ranges[beam] < beams.max_range else np.inf


def panorama_error(
    one: Float64[np.ndarray, "directions"], other: Float64[np.ndarray, "directions"]
) -> float:
    """Return the median distance of what two panoramas show from what is shown there by the other.

    Of each direction in which something came back, the range counts (m), beside the most alike one
    of the other panorama within `_SLACK` directions. The difference is infinite if nothing came
    back there, and so is the result if no direction counts. Where one was not looked in, none does.
    """
    errors = []
    for here, there in ((one, other), (other, one)):
        shown = np.isfinite(here) & (here != UNSEEN) & (there != UNSEEN)
        beside = np.stack([np.roll(there, shift) for shift in range(-_SLACK, _SLACK + 1)])
        beside[beside == UNSEEN] = np.inf
        errors.append(np.abs(beside[:, shown] - here[shown]).min(axis=0))
    found = np.concatenate(errors)
    return float(np.median(found)) if len(found) else math.inf
