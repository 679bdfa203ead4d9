"""Recognising landmark surfaces of the last view in this one (algorithm 1)."""

from __future__ import annotations

import numpy as np
from numba import njit

from albot_core.albot1.config import Limits
from albot_core.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.perception.surfaces import NO_EDGE

END, GAP, ANGLE, DISTANCE = 0, 1, 2, 3
"""Columns of `pairs`: which end was recognised, how far it is from where it was expected
(m), how far the surface is turned from what was expected (rad), and the end's distance
from the robot in the last view (m)."""


@njit(cache=True)
def heading_of(surface: np.ndarray) -> float:
    """Direction of a surface from its first end to its second (rad)."""
    return float(np.arctan2(surface[3] - surface[1], surface[2] - surface[0]))


@njit(cache=True)
def length_of(surface: np.ndarray) -> float:
    """Length of a surface (m)."""
    x, y = surface[2] - surface[0], surface[3] - surface[1]
    return float(np.sqrt(x * x + y * y))


@njit(cache=True)
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi), for angles in [-3 pi, 3 pi): all sums of two headings."""
    if angle >= np.pi:
        return angle - 2 * np.pi
    if angle < -np.pi:
        return angle + 2 * np.pi
    return angle


@njit(cache=True)
def seen_from(pose: np.ndarray, surface: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` the surface as seen from a pose (equations 3.1 to 3.4).

    The thesis faces +y and writes the displacement as a distance and an angle; here the
    robot faces +x and the pose is x, y, heading.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for end in range(2):
        x, y = surface[2 * end] - pose[0], surface[2 * end + 1] - pose[1]
        out[2 * end] = cos * x + sin * y
        out[2 * end + 1] = cos * y - sin * x


@njit(cache=True)
def recognize_landmarks(
    previous: Sight, current: Sight, motion: np.ndarray, limits: Limits, pairs: np.ndarray
) -> int:
    """Algorithm 1: which landmarks recognised in `previous` are landmarks of `current`.

    Fills `current.slots` and, for every recognised surface, its row of `pairs`; returns how
    many landmarks of the current view were recognised.
    """
    current.slots[: current.size[0]] = NOT_RECOGNIZED
    expected = np.empty(4)
    for i in range(previous.size[0]):
        if previous.slots[i] == NOT_RECOGNIZED:
            continue
        seen_from(motion, previous.surfaces[i], expected)  # Alg. 1, line 2
        heading = heading_of(expected)
        for j in range(current.size[0]):
            if not current.landmark[j]:
                continue
            angle = abs(wrap(heading_of(current.surfaces[j]) - heading))
            if angle >= limits.landmark_angle:  # Alg. 1, line 6
                continue
            for end in range(2):
                if previous.edges[i, end] == NO_EDGE or current.edges[j, end] == NO_EDGE:
                    continue
                gap = np.hypot(
                    current.surfaces[j, 2 * end] - expected[2 * end],
                    current.surfaces[j, 2 * end + 1] - expected[2 * end + 1],
                )
                if gap >= limits.landmark_gap:  # Alg. 1, line 7
                    continue
                # The last match stands, as in the algorithm; of its two ends the nearer.
                if current.slots[j] == previous.slots[i] and pairs[j, GAP] <= gap:
                    continue
                current.slots[j] = previous.slots[i]  # Alg. 1, line 8
                pairs[j, END] = end
                pairs[j, GAP] = gap
                pairs[j, ANGLE] = angle
                pairs[j, DISTANCE] = np.hypot(
                    previous.surfaces[i, 2 * end], previous.surfaces[i, 2 * end + 1]
                )
    return int(np.sum(current.slots[: current.size[0]] != NOT_RECOGNIZED))
