"""Poses and surfaces in the map's frame, the robot's, and others. Compiled.

A pose is x, y (m) and heading (rad). The thesis faces +y and writes a displacement as a distance
and an angle; here the robot faces +x.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.matching.lines import wrap


@kernel()
def compose_pose(pose: np.ndarray, motion: np.ndarray, out: np.ndarray) -> None:
    """Write into `out`, which may be `motion`, where a motion leads from a pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = motion[0], motion[1]
    out[0] = pose[0] + cos * x - sin * y
    out[1] = pose[1] + sin * x + cos * y
    out[2] = wrap(pose[2] + motion[2])


@kernel()
def relative_pose(frame: np.ndarray, pose: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` a pose as seen from a frame that is given beside it."""
    cos, sin = np.cos(frame[2]), np.sin(frame[2])
    x, y = pose[0] - frame[0], pose[1] - frame[1]
    out[0], out[1] = cos * x + sin * y, cos * y - sin * x
    out[2] = wrap(pose[2] - frame[2])


@kernel()
def to_map(pose: np.ndarray, surface: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` a surface seen from `pose`, in the map's frame."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for end in range(2):
        x, y = surface[2 * end], surface[2 * end + 1]
        out[2 * end] = pose[0] + cos * x - sin * y
        out[2 * end + 1] = pose[1] + sin * x + cos * y


@kernel()
def seen_from(
    pose: np.ndarray, cos: float, sin: float, surface: np.ndarray, out: np.ndarray
) -> None:
    """Write into `out` a surface as seen from a pose, with its heading's cosine and sine."""
    for end in range(2):
        x, y = surface[2 * end] - pose[0], surface[2 * end + 1] - pose[1]
        out[2 * end] = cos * x + sin * y  # Eq. (3.3)
        out[2 * end + 1] = cos * y - sin * x  # Eq. (3.4)
