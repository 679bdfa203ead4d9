"""Poses, points and angles in compiled code: the vocabulary of `poses`, one at a time.

The functions of the same name do the same to the same bits. Loops over points take the cosine and
the sine of the frame's heading, which are worked out once before the loop:

| compiled | result |
|---|---|
| `compose(first, second)` | x, y, heading of `second`, given in `first`, in the frame of `first` |
| `transform_point(frame, cos, sin, x, y)` | x, y of a point given in `frame`, outside it |
| `rotate(cos, sin, x, y)` | a vector turned counter-clockwise |
| `rotate_back(cos, sin, x, y)` | the same clockwise |
| `wrap_angle(angle)` | the same angle in [-pi, pi) |

Lengths and directions are worked out so that they are the same on every processor.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel

PoseLike = np.ndarray | tuple[float, float, float]
"""x, y, heading: compiled code takes either."""


@kernel()
def compose(first: PoseLike, second: PoseLike) -> tuple[float, float, float]:
    """The pose (x, y, heading) reached by `second` seen from `first`: first ⊕ second."""
    x, y = transform_point(first, math.cos(first[2]), math.sin(first[2]), second[0], second[1])
    return x, y, wrap_angle(first[2] + second[2])


@kernel()
def transform_point(
    frame: PoseLike, cos: float, sin: float, x: float, y: float
) -> tuple[float, float]:
    """A point given in `frame`, expressed in the frame that `frame` is given in."""
    return frame[0] + cos * x - sin * y, frame[1] + sin * x + cos * y


@kernel()
def rotate(cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """A vector turned counter-clockwise by an angle with this cosine and sine."""
    return cos * x - sin * y, sin * x + cos * y


@kernel()
def rotate_back(cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """A vector turned clockwise by an angle with this cosine and sine."""
    return cos * x + sin * y, cos * y - sin * x


@kernel()
def wrap_angle(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    shifted = angle + math.pi
    if not 0.0 <= shifted < 2 * math.pi:  # A remainder costs more than the comparison.
        shifted %= 2 * math.pi
    return shifted - math.pi


@kernel()
def length_of(u: float, v: float) -> float:
    """The length of (u, v): by a root, which is the same on every processor, as hypot is not."""
    return math.sqrt(u * u + v * v)


@kernel()
def pseudo_angle(u: float, v: float) -> float:
    """A number that grows with the direction of (u, v), from -2 to 2; the x axis is at 0.

    It orders directions as their angles do, without a trigonometric function.
    """
    part = v / max(abs(u) + abs(v), 1e-300)
    behind = 2.0 - part if v >= 0.0 else -2.0 - part
    return part if u >= 0.0 else behind


def angles_from_pseudo(numbers: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """The angles (rad) of the directions with these pseudo-angles."""
    sideways = np.where(np.abs(numbers) <= 1, numbers, np.sign(numbers) * 2 - numbers)
    ahead = np.where(np.abs(numbers) <= 1, 1, -1) * (1 - np.abs(sideways))
    return bearings_of(np.column_stack((ahead, sideways)))


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
