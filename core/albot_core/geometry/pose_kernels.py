"""Poses, points and angles in compiled code: the functions of `poses` for single values.

Functions with the same name give bit-identical results. Functions for points take the cosine and
the sine of the frame's heading, so that a loop computes these only once:

| compiled | result |
|---|---|
| `compose(first, second)` | x, y, heading of `second`, given in `first`, in the frame of `first` |
| `transform_point(frame, cos, sin, x, y)` | x, y of a point given in `frame`, outside of it |
| `rotate(cos, sin, x, y)` | a vector rotated counter-clockwise |
| `rotate_back(cos, sin, x, y)` | a vector rotated clockwise |
| `wrap_angle(angle)` | the same angle in [-pi, pi) |

Lengths and directions are computed so that they are bit-identical on every processor.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel

PoseLike = np.ndarray | tuple[float, float, float]
"""x, y, heading, as an array or a tuple."""


@kernel()
def compose(first: PoseLike, second: PoseLike) -> tuple[float, float, float]:
    """Return the composition first ⊕ second: the pose `second`, given in the frame `first`."""
    x, y = transform_point(first, math.cos(first[2]), math.sin(first[2]), second[0], second[1])
    return x, y, wrap_angle(first[2] + second[2])


@kernel()
def transform_point(
    frame: PoseLike, cos: float, sin: float, x: float, y: float
) -> tuple[float, float]:
    """Transform a point from `frame` to the frame in which `frame` is given."""
    return frame[0] + cos * x - sin * y, frame[1] + sin * x + cos * y


@kernel()
def rotate(cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """Rotate a vector counter-clockwise by an angle with this cosine and sine."""
    return cos * x - sin * y, sin * x + cos * y


@kernel()
def rotate_back(cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """Rotate a vector clockwise by an angle with this cosine and sine."""
    return cos * x + sin * y, cos * y - sin * x


@kernel()
def wrap_angle(angle: float) -> float:
    """Return the same angle in [-pi, pi)."""
    shifted = angle + math.pi
    if not 0.0 <= shifted < 2 * math.pi:  # The remainder costs more than the comparison.
        shifted %= 2 * math.pi
    return shifted - math.pi


@kernel()
def length_of(u: float, v: float) -> float:
    """Return the length of (u, v); unlike hypot, sqrt is bit-identical on every processor."""
    return math.sqrt(u * u + v * v)


@kernel()
def pseudo_angle(u: float, v: float) -> float:
    """Return a number in [-2, 2] that grows with the direction of (u, v); 0 on the x axis.

    It orders directions like their angles, without a trigonometric function.
    """
    part = v / max(abs(u) + abs(v), 1e-300)
    behind = 2.0 - part if v >= 0.0 else -2.0 - part
    return part if u >= 0.0 else behind


def angles_from_pseudo(numbers: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """Return the angles (rad) of the directions with these pseudo-angles."""
    sideways = np.where(np.abs(numbers) <= 1, numbers, np.sign(numbers) * 2 - numbers)
    ahead = np.where(np.abs(numbers) <= 1, 1, -1) * (1 - np.abs(sideways))
    return bearings_of(np.column_stack((ahead, sideways)))


@kernel(arrays=True)
def bearings_of(
    points: Float64[np.ndarray, "points 2"],
) -> Float64[np.ndarray, "points"]:
    """Return the directions of points (rad), counter-clockwise from the x axis.

    It calls the C library's atan2 for each point. numpy's arctan2 over arrays rounds differently on
    processors with AVX-512, and the last bit of one angle can change a whole run.
    """
    angles = np.empty(len(points))
    for k in range(len(points)):
        angles[k] = math.atan2(points[k, 1], points[k, 0])
    return angles
