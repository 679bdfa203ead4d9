"""What the robot has before it: a view, and what of it was recognised, in plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from albot_core.errors import InputError

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
    size: np.ndarray
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
        size=np.zeros(1, np.int64),
        pose=np.zeros(3),
    )


def rebuilt_sight(stored: Mapping[str, np.ndarray], capacity: int) -> Sight:
    """The view with the given fields, whose landmarks are in a map of that capacity.

    Raises:
        InputError: The fields contradict each other or the map.
    """
    sight = empty_sight(len(stored["slots"]))
    for field, array in sight._asdict().items():
        if stored[field].shape != array.shape:
            raise InputError(f"sight.{field}", f"shape {array.shape}", str(stored[field].shape))
        array[...] = stored[field]
    if not 0 <= sight.size[0] <= len(sight.slots):
        raise InputError("sight.size", f"0 to {len(sight.slots)}", str(sight.size[0]))
    if ((sight.slots < NOT_RECOGNIZED) | (sight.slots >= capacity)).any():
        raise InputError("sight.slots", f"slots of a map of {capacity}", "others")
    if not (np.isfinite(sight.surfaces).all() and np.isfinite(sight.pose).all()):
        raise InputError("sight.surfaces", "finite surfaces and pose", "NaN or infinity")
    return sight
