"""Compiled geometry of the plane: transforms with precomputed cosine and sine, and segments."""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import rotate, transform_point
from albot_core.kernels.compiled import kernel

Transform = tuple[float, float, float, float]
"""Pose with precomputed heading terms: x, y (m), cosine and sine of the heading."""


@kernel()
def transform_of(pose: np.ndarray) -> Transform:
    """Return the transform of a pose x, y, heading (m, rad)."""
    return pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])


@kernel()
def transform_from(transform: Transform, x: float, y: float) -> tuple[float, float]:
    """Transform a point from the frame of a transform to the parent frame."""
    origin_x, origin_y, cos, sin = transform
    return transform_point((origin_x, origin_y, 0.0), cos, sin, x, y)


@kernel()
def compose_transforms(first: Transform, second: Transform) -> Transform:
    """Return first ⊕ second: the parent-frame transform of `second`, given in `first`'s frame."""
    x, y = transform_from(first, second[0], second[1])
    cos, sin = rotate(first[2], first[3], second[2], second[3])
    return x, y, cos, sin
