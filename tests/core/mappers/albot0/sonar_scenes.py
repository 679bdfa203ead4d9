"""A robot with sonars, driven through hand-drawn scenes; every echo is worked out wall by wall."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from albot_core.geometry.poses import relative
from albot_core.sensing.reading import Reading, SonarGeometry, SonarScan

SONAR = SonarGeometry()


def row_of_rooms() -> tuple[np.ndarray, list[float]]:
    """Corridors 2 m wide and rooms in turn, along the x axis; and where each begins and ends (m).

    A corridor of 8 m, a room 6 m square, a corridor of 5 m, a room 8 m square, a corridor of 10 m.
    """
    walls, x, bounds = [], 0.0, [0.0]
    for length, half in ((8.0, 1.0), (6.0, 3.0), (5.0, 1.0), (8.0, 4.0), (10.0, 1.0)):
        walls += [(x, side, x + length, side) for side in (half, -half)]
        if half > 1.0:
            for end in (x, x + length):
                walls += [(end, 1.0, end, half), (end, -1.0, end, -half)]
        x += length
        bounds.append(x)
    return np.array(walls), bounds


def sonar_from(pose: np.ndarray, walls: np.ndarray) -> SonarScan:
    """What lies on the axes of the sonars (m)."""
    ranges = np.full(len(SONAR.bearings), np.inf)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for i, (bearing, (east, north)) in enumerate(zip(SONAR.bearings, SONAR.places, strict=True)):
        x, y = pose[0] + cos * east - sin * north, pose[1] + sin * east + cos * north
        dx, dy = np.cos(pose[2] + bearing), np.sin(pose[2] + bearing)
        wx, wy = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
        cross = dx * wy - dy * wx
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = ((walls[:, 0] - x) * wy - (walls[:, 1] - y) * wx) / cross
            along = ((walls[:, 0] - x) * dy - (walls[:, 1] - y) * dx) / cross
        met = (np.abs(cross) > 1e-9) & (reach > 0) & (along >= 0) & (along <= 1)
        if met.any() and reach[met].min() < SONAR.max_range:
            ranges[i] = reach[met].min()
    return SonarScan(ranges=ranges, geometry=SONAR)


def driven(*waypoints: tuple[float, float], spacing: float = 0.1) -> np.ndarray:
    """Poses (n, 3) on the way through waypoints, with turns of 0.2 rad on the spot between."""
    poses: list[np.ndarray] = []
    for start, end in pairwise(waypoints):
        way = np.subtract(end, start)
        heading = float(np.arctan2(way[1], way[0]))
        if poses:
            before = poses[-1]
            turn = (heading - before[2] + np.pi) % (2 * np.pi) - np.pi
            turns = np.linspace(0, turn, max(2, int(abs(turn) / 0.2) + 1))[1:]
            poses += [np.array((*before[:2], before[2] + each)) for each in turns]
        shares = np.linspace(0, 1, max(2, round(np.hypot(*way) / spacing) + 1))
        poses += [np.array((*(np.array(start) + share * way), heading)) for share in shares]
    return np.array(poses)


def readings(walls: np.ndarray, way: np.ndarray) -> list[Reading]:
    """What is heard on the way, with an exact odometer."""
    motions = relative(np.concatenate((way[:1], way[:-1])), way)
    return [
        Reading(stamp=0.1 * k, motion=motions[k], sonar=sonar_from(pose, walls))
        for k, pose in enumerate(way)
    ]
