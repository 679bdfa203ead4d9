"""The outlines of rooms, and which of them holds a point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_maps.world import Room


class Outlines(NamedTuple):
    """Outlines of rooms, in the form that compiled code takes."""

    corners: np.ndarray
    """(corners, 2) float64: corners of all rooms, one room after another (m)."""
    spans: np.ndarray
    """(rooms, 2) int64: where each room's corners begin and end in `corners`."""
    bounds: np.ndarray
    """(rooms, 4) float64: minimum x and y, maximum x and y of each room (m)."""


NO_ROOMS = Outlines(np.empty((0, 2)), np.empty((0, 2), np.int64), np.empty((0, 4)))


def outlines_of(rooms: tuple[Room, ...]) -> Outlines:
    """Return the outlines of a world's rooms."""
    outlines = [np.asarray(room.boundary, np.float64) for room in rooms]
    ends = np.cumsum([0, *(len(outline) for outline in outlines)], dtype=np.int64)
    bounds = [np.concatenate((outline.min(axis=0), outline.max(axis=0))) for outline in outlines]
    return Outlines(
        corners=np.concatenate([NO_ROOMS.corners, *outlines]),
        spans=np.stack((ends[:-1], ends[1:]), axis=1),
        bounds=np.array(bounds).reshape(-1, 4),
    )


def joined(some: Outlines, others: Outlines) -> Outlines:
    """Return the outlines of `some` followed by `others`."""
    return Outlines(
        corners=np.concatenate((some.corners, others.corners)),
        spans=np.concatenate((some.spans, others.spans + len(some.corners))),
        bounds=np.concatenate((some.bounds, others.bounds)),
    )


@kernel()
def find_room(x: float, y: float, outlines: Outlines, first: int, last: int) -> int:
    """Return the first of the rooms `first` to `last` that contains a point; -1 if none does.

    A point is inside if a ray to +x crosses the outline an odd number of times.
    """
    corners, spans, bounds = outlines
    for room in range(first, last):
        left, bottom, right, top = bounds[room]
        if not (left <= x <= right and bottom <= y <= top):
            continue
        inside = False
        before = spans[room, 1] - 1
        for k in range(spans[room, 0], spans[room, 1]):
            x1, y1 = corners[before, 0], corners[before, 1]
            x2, y2 = corners[k, 0], corners[k, 1]
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
                inside = not inside
            before = k
        if inside:
            return room
    return -1


class Rooms(NamedTuple):
    """The rooms of all robots' worlds, and which of them each robot has entered."""

    outlines: Outlines
    """Outlines of the rooms of all worlds."""
    worlds: np.ndarray
    """(n, 2) int64: where the rooms of each robot's world begin and end in `outlines`."""
    entered: np.ndarray
    """(n, most) bool: which rooms of its world each robot has entered."""
