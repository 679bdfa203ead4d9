"""What the robot has before it: a view, and what of it was recognised, in plain arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NOT_RECOGNIZED = -1
"""In `Sight.slots`: this surface is no recognised landmark."""


class Sight(NamedTuple):
    """The arrays of one view with room for `len(surfaces)` surfaces, in the robot's frame."""

    surfaces: np.ndarray
    """(room, 4) float64: x1, y1, x2, y2 in the robot's frame (m)."""
    edges: np.ndarray
    """(room, 2) int8: what the two ends are (see `perception.surfaces`)."""
    landmark: np.ndarray
    """(room,) bool: the surface is a landmark."""
    slots: np.ndarray
    """(room,) int64: the map's slot of the surface it was recognised as, or NOT_RECOGNIZED."""
    count: np.ndarray
    """(1,) int64: how many surfaces the view has."""
    pose: np.ndarray
    """(3,) float64: where in the map the robot believed to see this from."""


def empty_sight(room: int) -> Sight:
    """A view of nothing with room for `room` surfaces, seen from the map's origin."""
    return Sight(
        surfaces=np.zeros((room, 4)),
        edges=np.zeros((room, 2), np.int8),
        landmark=np.zeros(room, np.bool_),
        slots=np.full(room, NOT_RECOGNIZED, np.int64),
        count=np.zeros(1, np.int64),
        pose=np.zeros(3),
    )
