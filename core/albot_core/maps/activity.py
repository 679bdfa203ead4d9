"""The activity of an attractor network that estimates the robot's pose.

Renderers and recordings depend on this type and not on a mapping system. It is not a layer of a
map, because it lies in the network's own plane, which wraps around.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.ranges import POSITIVE, check_fields

MOST_CELLS = 4096
"""Largest number of cells along each axis of the plane."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Activity:
    """Activity over the plane (x', y'): the maximum over θ' at each position.

    The origin of its frame is the outer corner of cell [0, 0]. Columns run along x', rows along y'.

    Raises:
        InputError: The cell side is not a positive length, there are no or too many cells, or an
            activity is negative or not finite.
    """

    cell: float
    """Side of a cell (m)."""
    values: Float32[np.ndarray, "rows columns"]
    """Activity at each position, from 0."""
    packet: Pose
    """The centre of the largest packet (m, m, rad)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "cell")
        rows, columns = self.values.shape
        if not (0 < rows <= MOST_CELLS and 0 < columns <= MOST_CELLS):
            expected = f"1 to {MOST_CELLS} rows and columns"
            raise InputError("Activity.values", expected, f"{rows} × {columns}")
        if not (np.isfinite(self.values).all() and (self.values >= 0).all()):
            raise InputError(
                "Activity.values", "finite numbers from 0", "negative numbers, NaN or infinity"
            )

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the plane (m)."""
        rows, columns = self.values.shape
        return columns * self.cell, rows * self.cell


def packet_segments(packets: Points, size: tuple[float, float]) -> Segments:
    """Return the path of a packet over a plane as segments, without those that wrap around.

    Args:
        packets: The packet's positions, in the order of time (m).
        size: Width and height of the plane (m).
    """
    goes_round = (np.abs(np.diff(packets, axis=0)) > np.array(size) / 2).any(axis=1)
    return np.concatenate((packets[:-1], packets[1:]), axis=1)[~goes_round]
