"""Compiled look ahead: how near the robot comes to things before it stands."""

from __future__ import annotations

import math

import numpy as np

from albot_core.kernels.compiled import kernel

_PIECES = 4
"""Pieces of a control step in which the robot is taken to drive evenly."""


@kernel()
def _ramp(left: float, right: float, goal: tuple[float, float], most: float) -> tuple[float, float]:
    """Wheel speeds changed towards others, in proportion, by at most `most` (m/s)."""
    change = max(abs(goal[0] - left), abs(goal[1] - right))
    share = most / change if change > most else 1.0
    return left + share * (goal[0] - left), right + share * (goal[1] - right)


@kernel()
def least_distance(
    points: np.ndarray,
    motion: tuple[float, float],
    command: tuple[float, float],
    wheel_base: float,
    acceleration: float,
    step: float,
) -> float:
    """Least distance (m) from points to the robot's middle until it stands.

    For one control step it obeys a command and brakes from then on, both wheels at the
    acceleration that they have (m/s²).

    Args:
        points: (n, 2) in the robot's frame now (m).
        motion: Its speed (m/s) and turn rate (rad/s) now.
        command: Speed and turn rate that it is asked for.
        wheel_base: Distance between the wheels (m).
        acceleration: Greatest change of a wheel's speed in a second (m/s²).
        step: Duration of a control step (s).
    """
    half = wheel_base / 2
    left, right = motion[0] - half * motion[1], motion[0] + half * motion[1]
    goal = command[0] - half * command[1], command[0] + half * command[1]
    piece = step / _PIECES
    x = y = heading = 0.0
    least, k = np.inf, 0
    while k < _PIECES or left != 0.0 or right != 0.0:
        if k == _PIECES:
            goal = 0.0, 0.0
        left, right = _ramp(left, right, goal, acceleration * piece)
        way, turn = piece * (left + right) / 2, piece * (right - left) / wheel_base
        x += way * math.cos(heading + turn / 2)
        y += way * math.sin(heading + turn / 2)
        heading += turn
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - x, points[i, 1] - y
            least = min(least, dx * dx + dy * dy)
        k += 1
    return math.sqrt(least)
