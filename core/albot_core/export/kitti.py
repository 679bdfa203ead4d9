"""Trajectories in KITTI's format, one pose per line: the upper three rows of its 4 × 4 matrix.

The twelve numbers are r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z: the matrix that takes points of
the robot's frame (x forward, y left, z up) to the trajectory's frame. The format has no time.
https://www.cvlibs.net/datasets/kitti/eval_odometry.php, "readme.txt" of the development kit.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from albot_core.evaluation.trajectory import Trajectory
from albot_core.files import write_text


def write_kitti(trajectory: Trajectory, path: Path) -> None:
    """Write a trajectory, atomically. Positions read back exactly, headings up to rounding.

    Unlike in KITTI's own files, the axes are a robot's and not a camera's, and the first pose is
    the trajectory's, which need not be the identity.
    """
    lines = []
    for x, y, heading in trajectory.poses.tolist():
        cos, sin = float(np.cos(heading)), float(np.sin(heading))
        numbers = (cos, -sin, 0.0, x, sin, cos, 0.0, y, 0.0, 0.0, 1.0, 0.0)
        lines.append(" ".join(repr(number + 0.0) for number in numbers) + "\n")
    write_text(path, "".join(lines))
