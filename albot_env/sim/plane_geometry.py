"""Compiled geometry of the plane: distances of points, segments and sectors."""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.directions import length_of
from albot_core.kernels.compiled import kernel


@kernel()
def nearest_on_segment(
    x: float, y: float, x1: float, y1: float, x2: float, y2: float
) -> tuple[float, float]:
    """The point of a segment that is nearest to a point."""
    along_x, along_y = x2 - x1, y2 - y1
    squared = along_x * along_x + along_y * along_y
    share = ((x - x1) * along_x + (y - y1) * along_y) / squared if squared > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return x1 + share * along_x, y1 + share * along_y


Transform = tuple[float, float, float, float]
"""Where something is, x and y (m), and the cosine and sine of its heading."""


@kernel()
def transform_of(pose: np.ndarray) -> Transform:
    """The transform of what is at a pose x, y, heading (m, rad)."""
    return pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])


@kernel()
def compose_transforms(transform: Transform, mount: Transform) -> Transform:
    """The transform of what is compose_transforms on something; `mount` is told in its frame."""
    x, y, cos, sin = transform
    ahead, aside, its_cos, its_sin = mount
    return (
        x + cos * ahead - sin * aside,
        y + sin * ahead + cos * aside,
        cos * its_cos - sin * its_sin,
        sin * its_cos + cos * its_sin,
    )


@kernel()
def distance_to_ray(x: float, y: float, angle: float, length: float) -> float:
    """Distance of a point from a segment that leaves the origin at an angle."""
    end_x, end_y = length * math.cos(angle), length * math.sin(angle)
    near_x, near_y = nearest_on_segment(x, y, 0.0, 0.0, end_x, end_y)
    return length_of(x - near_x, y - near_y)


@kernel()
def distance_to_sector(x: float, y: float, first: float, turn: float, radius: float) -> float:
    """Distance of a point from the sector about the origin that a ray sweeps."""
    ahead = (math.atan2(y, x) - first) * (1.0 if turn >= 0.0 else -1.0)
    if ahead % (2.0 * math.pi) <= abs(turn):
        return max(0.0, length_of(x, y) - radius)
    gap = distance_to_ray(x, y, first, radius)
    return min(gap, distance_to_ray(x, y, first + turn, radius))
