"""Locating the robot in the perceptual map by one landmark (algorithm 2)."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.memory import Memory
from albot_core.mappers.albot1.recognition import ANGLE, DISTANCE, END, GAP
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight
from albot_core.matching.lines import heading_of, length_of, wrap

TINY = 1e-6
"""Gaps and angles below this (m, rad) do not make a landmark any better."""


@kernel()
def _pose_by(remembered: np.ndarray, seen: np.ndarray, end: int, pose: np.ndarray) -> None:
    """Write the pose from which the remembered surface looks as the seen one does.

    Equations 3.6 and 3.7 place the robot at its distance and angle from the landmark; the
    same rigid motion is written here by the two surfaces' directions and the common point.
    """
    pose[2] = wrap(heading_of(remembered) - heading_of(seen))
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = seen[2 * end], seen[2 * end + 1]
    pose[0] = remembered[2 * end] - (cos * x - sin * y)
    pose[1] = remembered[2 * end + 1] - (sin * x + cos * y)


@kernel(arrays=True)
def localize(memory: Memory, current: Sight, pairs: np.ndarray) -> None:
    """Algorithm 2: set `current.pose` by the best of the recognised landmarks.

    Every landmark gives a localisation point. Those farther from their average than their
    standard deviation are discarded; of the rest the landmark of highest goodness counts.
    """
    room = current.size[0]
    poses = np.empty((room, 3))
    which = np.empty(room, np.int64)
    found = 0
    for j in range(room):
        if current.slots[j] != NOT_RECOGNIZED:
            remembered = memory.surfaces[current.slots[j]]
            _pose_by(remembered, current.surfaces[j], int(pairs[j, END]), poses[found])
            which[found] = j
            found += 1
    mean_x = mean_y = variance = 0.0
    for k in range(found):
        mean_x += poses[k, 0] / found
        mean_y += poses[k, 1] / found
    for k in range(found):
        variance += ((poses[k, 0] - mean_x) ** 2 + (poses[k, 1] - mean_y) ** 2) / found
    best = -1.0
    for k in range(found):
        if np.hypot(poses[k, 0] - mean_x, poses[k, 1] - mean_y) > np.sqrt(variance) + TINY:
            continue
        j = which[k]
        # Eq. (3.5); perfect agreement would divide by zero.
        goodness = length_of(current.surfaces[j]) / (
            max(pairs[j, DISTANCE], TINY) * max(pairs[j, GAP], TINY) * max(pairs[j, ANGLE], TINY)
        )
        if goodness > best:
            best = goodness
            for i in range(3):
                current.pose[i] = poses[k, i]
