"""Which room a robot is in, and which it has been in."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Pose
from albot_env.tasks.kernels import find_room
from albot_maps.world import Room


def outlines_of(
    rooms: tuple[Room, ...],
) -> tuple[Float64[np.ndarray, "corners 2"], Int64[np.ndarray, "rooms 2"]]:
    """The corners of all rooms' outlines one after another, where each room's begin and end."""
    outlines = [np.asarray(room.boundary, np.float64) for room in rooms]
    ends = np.cumsum([0, *(len(outline) for outline in outlines)], dtype=np.int64)
    spans = np.stack((ends[:-1], ends[1:]), axis=1)
    return np.concatenate([np.empty((0, 2)), *outlines]), spans


class RoomLog:
    """Keeps which rooms of a world were entered.

    Args:
        rooms: The world's rooms; where they overlap, the first counts.
    """

    def __init__(self, rooms: tuple[Room, ...]) -> None:
        self._names = tuple(room.name for room in rooms)
        self._corners, self._spans = outlines_of(rooms)
        self._entered: set[int] = set()

    @property
    def entered(self) -> int:
        """How many rooms were entered."""
        return len(self._entered)

    def clear(self) -> None:
        """Forget all visits."""
        self._entered.clear()

    def enter(self, pose: Pose) -> tuple[str, bool]:
        """Note where the robot is: the room's name, empty between rooms, and whether it is new."""
        room = find_room(pose[0], pose[1], self._corners, self._spans, 0, len(self._spans))
        new = room >= 0 and room not in self._entered
        if new:
            self._entered.add(room)
        return (self._names[room] if room >= 0 else ""), new
