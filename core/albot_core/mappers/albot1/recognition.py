"""Recognising landmark surfaces of the last view in this one (algorithm 1)."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.matching.lines import heading_of, wrap
from albot_core.sensing.surfaces import NO_EDGE

END, GAP, ANGLE, DISTANCE = 0, 1, 2, 3
"""Columns of `pairs`: which end was recognised, how far it is from where it was expected
(m), how far the surface is turned from what was expected (rad), and the end's distance
from the robot in the last view (m)."""


@kernel()
def moved(pose: np.ndarray, motion: np.ndarray, out: np.ndarray) -> None:
    """Write into `out`, which may be `motion`, where a motion leads from a pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = motion[0], motion[1]
    out[0] = pose[0] + cos * x - sin * y
    out[1] = pose[1] + sin * x + cos * y
    out[2] = wrap(pose[2] + motion[2])


@kernel()
def pose_in(frame: np.ndarray, pose: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` a pose as it is in a frame that is given beside it."""
    cos, sin = np.cos(frame[2]), np.sin(frame[2])
    x, y = pose[0] - frame[0], pose[1] - frame[1]
    out[0], out[1] = cos * x + sin * y, cos * y - sin * x
    out[2] = wrap(pose[2] - frame[2])


@kernel()
def seen_from(pose: np.ndarray, surface: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` the surface as seen from a pose (equations 3.1 to 3.4).

    The thesis faces +y and writes the displacement as a distance and an angle; here the
    robot faces +x and the pose is x, y, heading.
    """
    seen_along(pose, np.cos(pose[2]), np.sin(pose[2]), surface, out)


@kernel()
def seen_along(
    pose: np.ndarray, cos: float, sin: float, surface: np.ndarray, out: np.ndarray
) -> None:
    """`seen_from` where cosine and sine of the pose's heading are known."""
    for end in range(2):
        x, y = surface[2 * end] - pose[0], surface[2 * end + 1] - pose[1]
        out[2 * end] = cos * x + sin * y
        out[2 * end + 1] = cos * y - sin * x


@kernel()
def _nearest_end(
    expected: np.ndarray, ends: np.ndarray, seen: np.ndarray, seen_ends: np.ndarray
) -> tuple[int, float]:
    """Which occluding or corner point the two surfaces share, and how far apart it is (m)."""
    nearest, which = np.inf, -1
    for end in range(2):
        if ends[end] != NO_EDGE and seen_ends[end] != NO_EDGE:
            dx, dy = seen[2 * end] - expected[2 * end], seen[2 * end + 1] - expected[2 * end + 1]
            gap = np.sqrt(dx * dx + dy * dy)
            if gap < nearest:
                nearest, which = gap, end
    return which, nearest


@kernel(arrays=True)
def recognize_landmarks(
    previous: Sight, current: Sight, motion: np.ndarray, limits: Limits, pairs: np.ndarray
) -> int:
    """Algorithm 1: which landmarks recognised in `previous` are landmarks of `current`.

    Fills `current.slots` and, for every recognised surface, its row of `pairs`; returns how
    many landmarks of the current view were recognised. The last match of a surface stands.
    """
    for j in range(current.size[0]):
        current.slots[j] = NOT_RECOGNIZED
    expected = np.empty(4)
    for i in range(previous.size[0]):
        if previous.slots[i] == NOT_RECOGNIZED:
            continue
        seen_from(motion, previous.surfaces[i], expected)  # Alg. 1, line 2
        heading = heading_of(expected)
        for j in range(current.size[0]):
            angle = abs(wrap(heading_of(current.surfaces[j]) - heading))
            if not current.landmark[j] or angle >= limits.landmark_angle:  # line 6
                continue
            end, gap = _nearest_end(
                expected, previous.edges[i], current.surfaces[j], current.edges[j]
            )
            if gap >= limits.landmark_gap:  # line 7
                continue
            current.slots[j] = previous.slots[i]  # lines 8 and 9
            x, y = previous.surfaces[i, 2 * end], previous.surfaces[i, 2 * end + 1]
            pairs[j, END], pairs[j, GAP], pairs[j, ANGLE] = end, gap, angle
            pairs[j, DISTANCE] = np.sqrt(x * x + y * y)
    recognized = 0
    for j in range(current.size[0]):
        recognized += current.slots[j] != NOT_RECOGNIZED
    return recognized
