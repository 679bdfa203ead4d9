"""The percept: what a planner goes by at a step: ranges, a believed pose, the last motion."""

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
    """What is known at a step, in metres and radians, in the robot's frame."""

    ranges: Float64[np.ndarray, "beams"]
    """Distance along every beam (m), the longest range where nothing was."""
    laser: LaserGeometry
    """Where the beams point."""
    pose: Pose
    """Where the robot believes to be; home is the origin."""
    motion: Pose
    """How the robot moved in the last step, by its odometer."""

    @cached_property
    def points(self) -> Float64[np.ndarray, "beams 2"]:
        """Where the beams end (m)."""
        return np.asarray(self.ranges[:, None] * self.laser.directions + self.laser.mount[:2])

    def to_map(self, points: Points) -> Points:
        """Points seen from the robot as points of the map (m)."""
        return transform_points(self.pose, points)

    def to_robot(self, points: Points) -> Points:
        """Points of the map as seen from the robot (m)."""
        return transform_points(inverse(self.pose), points)
