"""Whether two positions of a robot are the same place: the ground truth for recognition.

It must suit a mapper whose places are rooms as well as one whose places are half a metre wide.
So it compares two positions, not a mapper's places. Two positions are the same place if

- they are in the same room; or
- no wall and no doorway lies between them: two corridors that meet at their full width cannot be
  told apart by what is seen; or
- they are within `NEAR` of each other with no wall between: half a metre before a doorway and half
  a metre behind it look the same.

The second rule does not apply in a world that lists no exits, because a doorway may be missing.
Where neither rooms nor walls are known, as for a real robot's log, only the distance counts
(`albot_core.evaluation.recognition.NEAR`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.geometry.types import Points
from albot_core.kernels.compiled import kernel
from albot_maps.world import World

NEAR = 1.0
"""Positions closer than this (m) with no wall between are the same place."""
DOORWAY = 1.5
"""Largest width of a doorway (m); wider exits are not doorways."""


class Barriers(NamedTuple):
    """What separates places: the walls and doorways of several worlds, one world after another."""

    lines: np.ndarray
    """(all, 4) float64: line segments (m)."""
    spans: np.ndarray
    """(worlds, 3) int64, per world: index of the first wall, of the first doorway (the end of the
    walls), and the end of the doorways. The last is -1 if the world lists no exits."""


NO_BARRIERS = Barriers(np.empty((0, 4)), np.empty((0, 3), np.int64))
"""The barriers of zero worlds."""


def with_barriers(barriers: Barriers, world: World) -> Barriers:
    """Return `barriers` with those of one more world appended."""
    openings = np.reshape([opening.segment for opening in world.exits], (-1, 4)).astype(float)
    doorways = openings[np.hypot(*(openings[:, 2:] - openings[:, :2]).T) <= DOORWAY]
    walls = len(barriers.lines) + len(world.walls)
    end = walls + len(doorways) if world.exits else -1
    span = (len(barriers.lines), walls, end)
    return Barriers(
        lines=np.concatenate((barriers.lines, world.walls, doorways)),
        spans=np.concatenate((barriers.spans, np.array([span], np.int64))),
    )


@kernel()
def is_between(x1: float, y1: float, x2: float, y2: float, line: np.ndarray) -> bool:
    """Return whether `line` cuts or touches the segment from (x1, y1) to (x2, y2) (m)."""
    dx, dy = x2 - x1, y2 - y1
    ex, ey = line[2] - line[0], line[3] - line[1]
    one = dx * (line[1] - y1) - dy * (line[0] - x1)
    other = dx * (line[3] - y1) - dy * (line[2] - x1)
    if one == 0.0 and other == 0.0:  # All on one line.
        across = max(min(x1, x2), min(line[0], line[2])) <= min(max(x1, x2), max(line[0], line[2]))
        along = max(min(y1, y2), min(line[1], line[3])) <= min(max(y1, y2), max(line[1], line[3]))
        return bool(across and along)
    here = ex * (y1 - line[1]) - ey * (x1 - line[0])
    there = ex * (y2 - line[1]) - ey * (x2 - line[0])
    return bool(one * other <= 0.0 and here * there <= 0.0)


@kernel()
def is_same_place(
    x1: float,
    y1: float,
    room1: int,
    x2: float,
    y2: float,
    room2: int,
    world: int,
    barriers: Barriers,
) -> bool:
    """Return whether two positions (m) are the same place.

    `room1` and `room2` are room numbers, -1 outside all rooms. `world` is the row of the world
    in `barriers.spans`.
    """
    if room1 == room2 and room1 >= 0:
        return True
    walls, doorways, end = barriers.spans[world]
    near = (x2 - x1) ** 2 + (y2 - y1) ** 2 < NEAR * NEAR
    if not near and end < 0:
        return False
    for k in range(walls, doorways if near else end):
        if is_between(x1, y1, x2, y2, barriers.lines[k]):
            return False
    return True


@kernel(arrays=True)
def _compare(points: np.ndarray, rooms: np.ndarray, barriers: Barriers) -> np.ndarray:
    count = points.shape[0]
    same = np.zeros((count, count), np.bool_)
    for i in range(count):
        x, y = points[i]
        for k in range(i + 1):
            same[i, k] = same[k, i] = is_same_place(
                x, y, rooms[i], points[k, 0], points[k, 1], rooms[k], 0, barriers
            )
    return same


def same_places(
    world: World, points: Points, rooms: Int64[np.ndarray, "points"]
) -> Bool[np.ndarray, "points points"]:
    """Return for each pair of positions in a world whether they are the same place.

    Args:
        world: The world.
        points: The positions (world frame, m).
        rooms: Number of the room at each position; -1 outside all rooms.
    """
    return _compare(np.ascontiguousarray(points), rooms, with_barriers(NO_BARRIERS, world))
