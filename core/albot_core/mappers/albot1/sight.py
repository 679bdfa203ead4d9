"""What the robot has before it: a view, and what of it was recognised, in plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.kernels.compiled import kernel

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


ROOM = 64
"""Surfaces of a view that a new robot has room for."""


def empty_sight(room: int = ROOM) -> Sight:
    """A view of nothing with room for `room` surfaces, seen from the map's origin."""
    return Sight(
        surfaces=np.zeros((room, 4)),
        edges=np.zeros((room, 2), np.int8),
        landmark=np.zeros(room, np.bool_),
        slots=np.full(room, NOT_RECOGNIZED, np.int64),
        size=np.zeros(1, np.int64),
        pose=np.zeros(3),
    )


@kernel()
def copy_sight(source: Sight, target: Sight) -> None:
    """Make `target`, which has room for it, the same view."""
    target.size[0] = source.size[0]
    for i in range(3):
        target.pose[i] = source.pose[i]
    for k in range(source.size[0]):
        for i in range(4):
            target.surfaces[k, i] = source.surfaces[k, i]
        target.edges[k, 0], target.edges[k, 1] = source.edges[k, 0], source.edges[k, 1]
        target.landmark[k] = source.landmark[k]
        target.slots[k] = source.slots[k]


VIEWED = ("surfaces", "edges", "landmark", "slots")
"""The fields of a view with one row a surface."""


def stored_sight(sight: Sight) -> dict[str, np.ndarray]:
    """Copies of a view's fields, as far as they are in use."""
    stored = {field: getattr(sight, field)[: sight.size[0]].copy() for field in VIEWED}
    return stored | {"pose": sight.pose.copy()}


def rebuilt_sight(stored: Mapping[str, np.ndarray], slots: int) -> Sight:
    """The view with the given fields, whose landmarks are in a map that uses so many slots.

    Raises:
        InputError: The fields contradict each other or the map.
    """
    size = len(stored["slots"])
    sight = empty_sight(max(ROOM, size))
    sight.size[0] = size
    for field in (*VIEWED, "pose"):
        array = getattr(sight, field)
        shape = (3,) if field == "pose" else (size, *array.shape[1:])
        if stored[field].shape != shape:
            raise InputError(f"view.{field}", f"shape {shape}", str(stored[field].shape))
        array[: shape[0]] = stored[field]
    if ((sight.slots < NOT_RECOGNIZED) | (sight.slots >= slots)).any():
        raise InputError("view.slots", f"slots of a map of {slots}", "others")
    if not (np.isfinite(sight.surfaces).all() and np.isfinite(sight.pose).all()):
        raise InputError("view.surfaces", "finite surfaces and pose", "NaN or infinity")
    return sight
