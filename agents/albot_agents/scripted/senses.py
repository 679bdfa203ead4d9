"""What a scripted agent makes of an observation: ranges, a believed pose, covered ground."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32, Float64

from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.perception.reading import LaserGeometry
from albot_env.tasks.observation import ObservationConfig

LASER = LaserGeometry()
"""The laser whose ranges the observations hold."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Senses:
    """One observation in metres and radians, in the robot's frame."""

    ranges: Float64[np.ndarray, "beams"]
    """Distance along every beam (m), the longest range where nothing was."""
    pose: Pose
    """Where the robot believes to be; home is the origin."""
    patch: Float32[np.ndarray, "side side"]
    """Ground covered around the robot: 1 covered, -1 not; row 0 ahead, column 0 left."""
    patch_cell: float
    """Side of a cell of the patch (m)."""

    @property
    def patch_radius(self) -> float:
        """Distance (m) up to which the patch shows the ground in every direction."""
        return (len(self.patch) // 2 - 1) * self.patch_cell

    @cached_property
    def points(self) -> Float64[np.ndarray, "beams 2"]:
        """Where the beams end (m)."""
        return np.asarray(self.ranges[:, None] * LASER.directions)

    def covered(self, points: Points) -> Bool[np.ndarray, "*points"]:
        """Whether the ground at points (m, robot's frame) is covered; beyond the patch it is."""
        side = len(self.patch)
        cells = np.floor(side / 2 - points / self.patch_cell).astype(np.int64)
        inside = ((cells >= 0) & (cells < side)).all(axis=-1)
        row, column = np.clip(np.moveaxis(cells, -1, 0), 0, side - 1)
        return np.asarray(~inside | (self.patch[row, column] > 0))

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
    return Senses(
        ranges=config.ranges(parts["laser"]),
        # Home is the map's origin, so the robot is at minus the turned home vector.
        pose=np.array((sin * home_y - cos * home_x, -sin * home_x - cos * home_y, heading)),
        patch=parts["coverage"][0],
        patch_cell=config.coverage.patch_cell,
    )
