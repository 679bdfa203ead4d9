"""Compiled odometer: what is counted since the last reading, and how it is read.

A robot's `count` is x, y, heading (m, rad, in its frame at the last reading), distance and
turning (both without sign, m and rad). `errors` are the seven numbers of
`OdometerConfig.constants`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from albot_env.sim.noise_kernels import draw_normals


@njit(cache=True, error_model="numpy")
def roll(count: np.ndarray, left: float, right: float, duration: float, errors: np.ndarray) -> None:
    """Add what the wheels roll at these speeds (m/s) for a while (s)."""
    if left == 0.0 and right == 0.0:
        return
    left *= duration * errors[0]
    right *= duration * errors[1]
    turn = (right - left) / errors[2] + errors[3] * duration
    distance = (left + right) / 2
    half = turn / 2
    length = distance * math.sin(half) / half if half else distance
    count[0] += length * math.cos(count[2] + half)
    count[1] += length * math.sin(count[2] + half)
    count[2] += turn
    count[3] += abs(distance)
    count[4] += abs(turn)


@njit(cache=True, error_model="numpy")
def read(
    count: np.ndarray, errors: np.ndarray, key: np.uint64, place: int, motion: np.ndarray
) -> None:
    """Write the motion measured, with its random error, and begin to count anew."""
    noise_along, noise_heading = draw_normals(key, place)
    along = errors[4] * math.sqrt(count[3]) * noise_along
    error = noise_heading * math.sqrt(errors[5] ** 2 * count[3] + errors[6] ** 2 * count[4])
    # The heading's error grew on the way: half of it bends the way itself.
    cos, sin = math.cos(error / 2), math.sin(error / 2)
    x, y = count[0], count[1]
    reach = math.hypot(x, y)
    if reach > 0.0:
        x, y = x + along * x / reach, y + along * y / reach
    motion[0], motion[1] = cos * x - sin * y, sin * x + cos * y
    motion[2] = (count[2] + error + math.pi) % (2 * math.pi) - math.pi
    for i in range(5):
        count[i] = 0.0
