"""What is perceived of a place on one visit: its gateways, and its local map in points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points, Segments
from albot_core.mappers.hssh.gateways import FREE, WALL, Ground
from albot_core.mappers.hssh.region import continuations
from albot_core.mappers.hssh.star import Star

SPACING = 0.3
"""Distance of the points that are kept of the free ground (m)."""


class Visit(NamedTuple):
    """What was perceived of a place on one visit, in the frame of the odometry."""

    entered: int
    """Number of the reading at which the robot came."""
    way: float
    """Distance driven until then (m)."""
    arrived: int
    """The gateway through which it came; -1 at the first visit."""
    left: int
    """The gateway through which it left; -1 while it is there."""
    middle: Points
    """The middle of the most open ground of the place (m)."""
    gateways: Segments
    """The gateways, counter-clockwise, each with the place to its left (m)."""
    unknown: tuple[int, ...]
    """Where more gateways may lie, as nothing was seen: k for between gateway k and the one
    before."""
    surface: Points
    """Points on the walls of the place (m)."""
    open_ground: Points
    """Points on its free ground (m)."""

    @property
    def middles(self) -> Points:
        """The middles of the gateways (m)."""
        return np.asarray((self.gateways[:, :2] + self.gateways[:, 2:]) / 2)

    def star(self, straight: float) -> Star:
        """Return the local topology."""
        return Star(*continuations(self.gateways, straight), unknown=self.unknown)


def surface_of(
    ground: Ground, middle: Float64[np.ndarray, "2"], reach: float, most: int
) -> Float64[np.ndarray, "points 2"]:
    """Return points on the walls around a place, evenly chosen (m).

    Args:
        ground: The part of the local map.
        middle: The middle of the place (m).
        reach: Largest distance from there (m).
        most: Largest number of points.
    """
    points = _points_near(ground, WALL, middle, reach)
    step = max(math.ceil(len(points) / max(most, 1)), 1)
    return points[::step][:most]


def open_ground_of(
    ground: Ground, middle: Float64[np.ndarray, "2"], reach: float
) -> Float64[np.ndarray, "points 2"]:
    """Return points on the free ground around a place, in a grid of `SPACING` (m).

    Args:
        ground: The part of the local map.
        middle: The middle of the place (m).
        reach: Largest distance from there (m).
    """
    # The walls beside the outermost points must be within reach.
    step = max(round(SPACING / ground.cell), 1)
    return _points_near(ground, FREE, middle, reach - SPACING, step)


def _points_near(
    ground: Ground, state: np.int8, middle: Float64[np.ndarray, "2"], reach: float, step: int = 1
) -> Float64[np.ndarray, "points 2"]:
    """Return the centres of each `step`th cell of a state within `reach` of a point (m)."""
    around = (middle - ground.corner)[::-1] / ground.cell
    first = np.maximum((around - reach / ground.cell).astype(int) // step - 1, 0)
    end = np.maximum((around + reach / ground.cell).astype(int) // step + 2, 0)
    states = ground.states[::step, ::step][first[0] : end[0], first[1] : end[1]]
    points = ground.centres(step * (np.argwhere(states == state) + first))
    return np.asarray(points[np.hypot(*(points - middle).T) <= reach], np.float64)
