"""The frame: everything that can be drawn of one moment of an episode."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import length_of, transform_point
from albot_core.geometry.types import Pose
from albot_core.maps.layers import MapSnapshot
from albot_env.rendering.layers import layer_summary


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One moment of an episode: the truth beside what the mapper makes of it.

    A frame holds the truth, so it is for people and files, never for agents.
    """

    world: str
    """Name of the world."""
    mapper: str
    """Name of the mapper."""
    time: float
    """Simulated time since the start (s)."""
    path_length: float
    """Distance truly driven (m)."""
    updates: int
    """How many readings the mapper has added to its map."""
    walls: Float64[np.ndarray, "walls 4"]
    """The world's walls, world frame."""
    things: Float64[np.ndarray, "things 4"]
    """The outlines of what moves around the robot, world frame."""
    start: Pose
    """Where the robot truly set out, world frame."""
    pose: Pose
    """Where the robot truly is, world frame."""
    path: Float64[np.ndarray, "steps 2"]
    """Where the robot has truly been, world frame."""
    hits: Float64[np.ndarray, "hits 2"]
    """The points that the laser hit, in the robot's frame."""
    snapshot: MapSnapshot
    """The mapper's map, map frame."""
    belief: Pose
    """Where the robot believes to be, map frame."""
    believed_path: Float64[np.ndarray, "beliefs 2"]
    """Where the robot believed to be at each moment, map frame."""
    home: Pose
    """Where home is believed to be, in the robot's present frame."""

    @property
    def position_error(self) -> float:
        """Distance between the believed and the true position, aligned at the start (m)."""
        cos, sin = math.cos(self.start[2]), math.sin(self.start[2])
        x, y = transform_point(self.start, cos, sin, self.belief[0], self.belief[1])
        return length_of(x - self.pose[0], y - self.pose[1])

    @property
    def caption(self) -> str:
        """The frame's figures in one line."""
        minutes, seconds = divmod(self.time, 60)
        parts = (
            self.world,
            self.mapper,
            f"{minutes:.0f}:{seconds:04.1f}",
            f"{self.path_length:.1f} m driven",
            f"{self.updates} updates",
            *(layer_summary(layer) for layer in self.snapshot.layers),
            f"{self.position_error:.2f} m off",
        )
        return " · ".join(part for part in parts if part)
