"""Poses and surfaces in the map's frame, the robot's and others, written into arrays. Compiled.

As `geometry.pose_kernels`, but for whole surfaces, and with headings that keep their bits unless
they need wrapping. The thesis's robot faces +y, and a displacement is a distance and an angle; here
the robot faces +x, and a pose is x, y (m) and heading (rad).
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import rotate_back, transform_point
from albot_core.kernels.compiled import kernel
from albot_core.matching.lines import wrap


@kernel()
def compose_pose(pose: np.ndarray, motion: np.ndarray, out: np.ndarray) -> None:
    """Write into `out`, which may be `motion`, the pose to which a motion leads from `pose`."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    out[0], out[1] = transform_point(pose, cos, sin, motion[0], motion[1])
    out[2] = wrap(pose[2] + motion[2])


@kernel()
def relative_pose(frame: np.ndarray, pose: np.ndarray, out: np.ndarray) -> None:
    """Write into `out` the pose relative to `frame`; both are given in the same frame."""
    cos, sin = np.cos(frame[2]), np.sin(frame[2])
    out[0], out[1] = rotate_back(cos, sin, pose[0] - frame[0], pose[1] - frame[1])
    out[2] = wrap(pose[2] - frame[2])


@kernel()
def copy_pose(pose: np.ndarray, out: np.ndarray) -> None:
    """Write a pose into `out`."""
    for i in range(3):
        out[i] = pose[i]


@kernel()
def seen_from(
    pose: np.ndarray, cos: float, sin: float, surface: np.ndarray, out: np.ndarray
) -> None:
    """Write into `out` a surface relative to a pose; `cos` and `sin` are those of its heading.

    Eq. (3.3) and (3.4), for either end. The thesis finds the pose by eq. (3.1) and (3.2).
    """
    out[0], out[1] = rotate_back(cos, sin, surface[0] - pose[0], surface[1] - pose[1])
    out[2], out[3] = rotate_back(cos, sin, surface[2] - pose[0], surface[3] - pose[1])
