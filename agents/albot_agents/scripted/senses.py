"""What a scripted agent makes of an observation: ranges, a believed pose, its last motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.perception.reading import LaserGeometry
from albot_env.tasks.observation import ObservationConfig


@dataclass(frozen=True, kw_only=True, eq=False)
class Senses:
    """One observation in metres and radians, in the robot's frame."""

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


def make_sense(observation: Any, config: ObservationConfig) -> Senses:
    """Undo the scaling of an observation, flat or by part."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    heading = float(np.arctan2(parts["heading"][1], parts["heading"][0]))
    cos, sin = np.cos(heading), np.sin(heading)
    distance = config.home_distance(parts["home"][2])
    home_x, home_y = distance * parts["home"][0], distance * parts["home"][1]
    step = np.array((config.step_length, config.step_length, config.step_turn))
    return Senses(
        ranges=config.ranges(parts["laser"]),
        laser=config.laser,
        # Home is the map's origin, so the robot is at minus the turned home vector.
        pose=np.array((sin * home_y - cos * home_x, -sin * home_x - cos * home_y, heading)),
        motion=parts["motion"] * step,
    )
