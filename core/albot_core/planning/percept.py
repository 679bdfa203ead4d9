"""The percept, a planner's input at a step: ranges, estimated pose, last motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.sensing.reading import LaserGeometry


@dataclass(frozen=True, kw_only=True, eq=False)
class Percept:
    """A planner's input at a step, in metres and radians."""

    ranges: Float64[np.ndarray, "beams"]
    """Distance along every beam (m); the maximum range where there was no return."""
    laser: LaserGeometry
    """The beam geometry."""
    pose: Pose
    """The robot's estimated pose in the map's frame, whose origin is home."""
    motion: Pose
    """The robot's motion in the last step, by its odometer (m, m, rad)."""

    @cached_property
    def points(self) -> Float64[np.ndarray, "beams 2"]:
        """End points of the beams (m, robot's frame)."""
        return np.asarray(self.ranges[:, None] * self.laser.directions + self.laser.mount[:2])

    def to_map(self, points: Points) -> Points:
        """Transform points from the robot's frame to the map's frame (m)."""
        return transform_points(self.pose, points)

    def to_robot(self, points: Points) -> Points:
        """Transform points from the map's frame to the robot's frame (m)."""
        return transform_points(inverse(self.pose), points)
