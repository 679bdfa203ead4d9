"""Directions: as angles, the same on every processor, and as numbers that grow with them."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel


@kernel()
def turned(u: float, v: float) -> float:
    """Grows with the direction of (u, v), from -2 to 2 through the x axis at 0."""
    part = v / max(abs(u) + abs(v), 1e-300)
    behind = 2.0 - part if v >= 0.0 else -2.0 - part
    return part if u >= 0.0 else behind


@kernel()
def length_of(u: float, v: float) -> float:
    """The length of (u, v): by a root, which is the same on every processor, as hypot is not."""
    return math.sqrt(u * u + v * v)


@kernel()
def wrapped(angle: float) -> float:
    """An angle as one in [-pi, pi)."""
    shifted = angle + math.pi
    if not 0.0 <= shifted < 2 * math.pi:  # A remainder costs more than asking.
        shifted %= 2 * math.pi
    return shifted - math.pi


@kernel(arrays=True)
def bearings_of(
    points: Float64[np.ndarray, "points 2"],
) -> Float64[np.ndarray, "points"]:
    """The directions of points (rad), counter-clockwise from the x axis.

    By the C library's atan2, one point at a time: numpy's own over arrays rounds otherwise
    where the processor has AVX-512, and a whole journey can hang on the last bit of one angle.
    """
    angles = np.empty(len(points))
    for k in range(len(points)):
        angles[k] = math.atan2(points[k, 1], points[k, 0])
    return angles


def angles_of(numbers: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """The angles (rad) of the directions that `turned` makes these numbers of."""
    sideways = np.where(np.abs(numbers) <= 1, numbers, np.sign(numbers) * 2 - numbers)
    ahead = np.where(np.abs(numbers) <= 1, 1, -1) * (1 - np.abs(sideways))
    return bearings_of(np.column_stack((ahead, sideways)))
