"""The frame: everything that can be drawn of one moment of an episode."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.types import Pose


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
    """How often the mapper has added a view to its map."""
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
    surfaces: Float64[np.ndarray, "surfaces 4"]
    """The surfaces that the mapper remembers, map frame."""
    belief: Pose
    """Where the robot believes to be, map frame."""
    believed_path: Float64[np.ndarray, "beliefs 2"]
    """Where the robot believed to be at each moment, map frame."""
    home: Pose
    """Where home is believed to be, in the robot's present frame."""

    @property
    def position_error(self) -> float:
        """Distance between the believed and the true position, aligned at the start (m)."""
        return position_error(self.start, self.pose, self.belief)

    @property
    def caption(self) -> str:
        """The frame's figures in one line."""
        minutes, seconds = divmod(self.time, 60)
        return (
            f"{self.world} · {self.mapper} · {minutes:.0f}:{seconds:04.1f} · "
            f"{self.path_length:.1f} m driven · {self.updates} updates · "
            f"{len(self.surfaces)} surfaces · {self.position_error:.2f} m off"
        )


def position_error(start: Pose, pose: Pose, belief: Pose) -> float:
    """Distance (m) from the true position to the believed one, the map laid at the start.

    Args:
        start: Where the robot truly set out, world frame: the origin of the map's frame.
        pose: Where it truly is, world frame.
        belief: Where it believes to be, map frame.
    """
    cos, sin = math.cos(start[2]), math.sin(start[2])
    x = start[0] + cos * belief[0] - sin * belief[1]
    y = start[1] + sin * belief[0] + cos * belief[1]
    return length_of(x - pose[0], y - pose[1])
