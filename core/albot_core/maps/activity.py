"""The activity of an attractor network that says where the robot is.

Renderers and recordings know this type and no mapping system. It is no layer of a map: it lies in
the network's own plane, which wraps round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Segments

MOST_CELLS = 4096
"""A network has at most so many cells along each axis of the plane."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Activity:
    """Activity over the plane (x', y'): at each place that of the most active cell over θ'.

    Its frame has the outer corner of cell [0, 0] as origin; columns run along x', rows along y'.

    Raises:
        InputError: The side of a cell is no positive length, there are no cells or too many, or
            activity is not finite or negative.
    """

    cell: float
    """Side of a cell (m)."""
    values: Float32[np.ndarray, "rows columns"]
    """How active each place is, from 0."""
    packet: Pose
    """The centre of the largest packet (m, m, rad)."""

    def __post_init__(self) -> None:
        if not 0 < self.cell < np.inf:
            raise InputError("Activity.cell", "a positive length (m)", str(self.cell))
        rows, columns = self.values.shape
        if not (0 < rows <= MOST_CELLS and 0 < columns <= MOST_CELLS):
            expected = f"1 to {MOST_CELLS} rows and columns"
            raise InputError("Activity.values", expected, f"{rows} × {columns}")
        if not (np.isfinite(self.values).all() and (self.values >= 0).all()):
            raise InputError("Activity.values", "finite numbers from 0", "others")

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the plane (m)."""
        rows, columns = self.values.shape
        return columns * self.cell, rows * self.cell


def packet_segments(packets: Points, size: tuple[float, float]) -> Segments:
    """The way of a packet over a plane as lines, those left out that go round its edges.

    Args:
        packets: Where it was, in the order of time (m).
        size: Width and height of the plane (m).
    """
    goes_round = (np.abs(np.diff(packets, axis=0)) > np.array(size) / 2).any(axis=1)
    return np.concatenate((packets[:-1], packets[1:]), axis=1)[~goes_round]
