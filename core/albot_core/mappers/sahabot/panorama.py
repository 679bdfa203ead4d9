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
def carry_along(
    panorama: np.ndarray,
    offsets: np.ndarray,
    x: float,
    y: float,
    carried: np.ndarray,
    carried_offsets: np.ndarray,
) -> None:
    """Fill `carried` with a panorama as it is seen from a place x, y (m) farther on.

    A point keeps its exact bearing, so it moves on by many small steps as by one large one. A
    direction from which all points went shows the farther of its neighbours: what a nearer thing no
    longer hides is taken for more of what is seen beside it. Beside what was not looked at, it is
    unseen. Directions that were unseen, or in which nothing came back, stay so until a point comes.

    Args:
        panorama: (DIRECTIONS,) float64: the ranges (m).
        offsets: (DIRECTIONS,) float64: how far the point seen in each direction is beside it (rad).
        x: How far the robot moved in the start's heading (m).
        y: How far it moved to the left of it (m).
        carried: (DIRECTIONS,) float64: the ranges then (m); written over.
        carried_offsets: (DIRECTIONS,) float64: the offsets then (rad); written over.
    """
    count = panorama.shape[0]
    for k in range(count):
        carried[k] = np.nan
        carried_offsets[k] = 0.0
    for k in range(count):
        if 0.0 <= panorama[k] < np.inf:
            bearing = k * _SPACING + offsets[k]
            away = panorama[k] * math.cos(bearing) - x
            aside = panorama[k] * math.sin(bearing) - y
            bearing = math.atan2(aside, away)
            nearest = round(bearing / _SPACING)
            distance = math.sqrt(away * away + aside * aside)
            at = nearest % count
            if not carried[at] <= distance:  # Also where nothing is yet.
                carried[at] = distance
                carried_offsets[at] = bearing - nearest * _SPACING
    _fill_left(panorama, carried)


@kernel()
def _fill_left(panorama: np.ndarray, carried: np.ndarray) -> None:
    """Fill the directions of `carried` into which no point came, which are NaN."""
    count = panorama.shape[0]
    for k in range(count):
        if math.isnan(carried[k]) and not 0.0 <= panorama[k] < np.inf:
            carried[k] = panorama[k]
    for k in range(count):
        if math.isnan(carried[k]):
            after = k + 1
            while math.isnan(carried[after % count]):
                after += 1
            before = k - 1
            while math.isnan(carried[before]):
                before -= 1
            one, other = carried[before], carried[after % count]
            carried[k] = UNSEEN if UNSEEN in (one, other) else max(one, other)


@kernel(nogil=True)
def look(
    panorama: np.ndarray, offsets: np.ndarray, heading: float, beams: Beams, ranges: np.ndarray
) -> None:
    """Write a scan over those directions of a panorama in which it looks.

    Args:
        panorama: (DIRECTIONS,) float64: the ranges (m); written over.
        offsets: (DIRECTIONS,) float64: those of its points (rad), as for `carry_along`; written
            over.
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
            offsets[k] = 0.0


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
