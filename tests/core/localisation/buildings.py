"""Buildings whose walls are known exactly, and robots that are led through them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from albot_core.geometry.poses import relative
from albot_core.maps.layers import MapSnapshot, SegmentsLayer, TrajectoryLayer
from albot_core.sensing.reading import Reading
from tests.core.mappers.slam.rooms import reading_from


def _walls(*lines: tuple[float, float, float, float]) -> np.ndarray:
    return np.array(lines, float)


BUILDING = _walls(
    # Outline.
    (0, 0, 14, 0), (14, 0, 14, 9), (14, 9, 0, 9), (0, 9, 0, 0),
    # A wall from west to east, with three doors; the rooms are all of different widths.
    (0, 4, 1.5, 4), (2.5, 4, 6, 4), (7, 4, 11.5, 4), (12.5, 4, 14, 4),
    # Walls between the rooms, a niche, and a pillar.
    (4.2, 0, 4.2, 4), (9.4, 0, 9.4, 4), (6, 9, 6, 7.4), (6, 7.4, 7, 7.4), (7, 7.4, 7, 9),
    (10.5, 6.4, 11, 6.4), (11, 6.4, 11, 7.2), (11, 7.2, 10.5, 7.2), (10.5, 7.2, 10.5, 6.4),
)  # fmt: skip
"""Three rooms at a hall, 14 m by 9 m: no two places are alike."""
TOUR = ((2, 2), (2, 5.5), (6.5, 5.5), (6.5, 2), (6.5, 5.5), (12, 5.2), (12, 2), (12, 5.2), (3, 6.5))
"""A way through all of its rooms (m)."""
OTHER = _walls(
    (0, 0, 20, 0), (20, 0, 20, 6), (20, 6, 13, 11), (13, 11, 0, 6), (0, 6, 0, 0),
    (5, 0, 7, 2), (10, 3, 10, 7), (15, 0, 13, 3),
)  # fmt: skip
"""Another building, with slanting walls."""
OTHER_TOUR = ((3, 3), (8, 3), (8, 6), (12, 8), (13, 5), (17, 4))
TWINS = np.concatenate((BUILDING, 2 * np.array((14, 4.5) * 2) - BUILDING))
"""The building and itself turned by half a turn about a point of its eastern wall, wall to wall."""


def snapshot(walls: np.ndarray, *ways: tuple[tuple[float, float], ...]) -> MapSnapshot:
    """A perfect map of a building, seen along some ways."""
    seen = [pose for way in ways for pose in led(way)]
    layers = SegmentsLayer(segments=walls), TrajectoryLayer(poses=np.array(seen))
    return MapSnapshot(layers=layers)


def led(way: tuple[tuple[float, float], ...], step: float = 0.25) -> Iterator[np.ndarray]:
    """The poses of a robot that is led along a way; it turns before it drives on."""
    heading = None
    for here, there in pairwise(np.array(way, float)):
        to = there - here
        towards = float(np.arctan2(to[1], to[0]))
        before = towards if heading is None else heading
        turn = (towards - before + np.pi) % (2 * np.pi) - np.pi
        for part in np.arange(1, 1 + int(np.ceil(abs(turn) / 0.5))) / np.ceil(abs(turn) / 0.5 or 1):
            yield np.array((*here, before + part * turn))
        count = int(np.ceil(np.hypot(*to) / step))
        for part in np.arange(0 if heading is None else 1, count + 1) / count:
            yield np.array((*(here + part * to), towards))
        heading = towards


def readings(
    way: tuple[tuple[float, float], ...], walls: np.ndarray = BUILDING, error: float = 0.01
) -> list[tuple[Reading, np.ndarray]]:
    """What a robot reads along a way, and where it is; the odometer and the laser err a little."""
    rng = np.random.default_rng(7)
    poses, found = list(led(way)), []
    for before, pose in zip([poses[0], *poses], poses, strict=False):
        motion = relative(before, pose) + rng.normal(0.0, error, 3)
        reading = reading_from(pose, motion, walls)
        assert reading.laser is not None
        reading.laser.ranges[:] += rng.normal(0.0, error, len(reading.laser.ranges))
        found.append((reading, pose))
    return found
