"""Whether a map keeps the shape of the floor: as a whole, laid on the walls as it fits best.

The thesis judges by eye ("while such a measure is subjective, it suffices for now", section
3.2.1). Here the map is laid on the floor by the rigid motion that brings the believed
path nearest to the true one, and the distance of its surfaces to the walls is measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.evaluation.map_quality import surface_error
from albot_core.evaluation.trajectory import align
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Pose, Poses, Segments

SHAPE_BOUND = 0.2
"""The shape is kept where half of what a map remembers lies nearer than this to a wall (m): as
far as the walls of these floors are thick. A floor plan laid on itself askew, at random, has
0.5 to 0.8 m."""

_Walls = Float64[np.ndarray, "walls 4"]

_SPACING = 0.2
"""The distance is taken at points so far apart along the surfaces (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """How far a map is from the floor that it is a map of."""

    frame: Pose
    """The map's frame as a pose in the world's, under which the two paths agree best."""
    surface_error: float
    """Median distance from the surfaces to the true walls (m); infinite without surfaces."""
    path_error: float
    """Root of the mean squared distance from the believed to the true path (m; the ATE)."""


def shape_of(surfaces: Segments, poses: Poses, truth: Poses, walls: _Walls) -> Shape:
    """Measure a map's shape.

    Args:
        surfaces: What the map remembers, in the map's frame.
        poses: (views, 3): where the robot believed to be, in the map's frame.
        truth: (views, 3): where it was, in the world's.
        walls: The true walls.
    """
    frame = align(poses[:, :2], truth[:, :2])
    offsets = transform_points(frame, poses[:, :2]) - truth[:, :2]
    error = surface_error(surfaces, walls, frame, _SPACING)
    return Shape(
        frame=frame,
        surface_error=np.inf if error is None else error,
        path_error=float(np.sqrt((offsets**2).sum(axis=1).mean())),
    )


def median_and_worst(values: Sequence[float], digits: int = 3) -> dict[str, float]:
    """The two figures that are reported of a measure over the seeds."""
    return {
        "median": round(float(np.median(values)), digits),
        "worst": round(float(np.max(values)), digits),
    }
