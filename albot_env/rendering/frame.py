"""The frame: all data that can be drawn of one moment of an episode."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import length_of, transform_point
from albot_core.geometry.types import Pose
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_env.rendering.layers import layer_summary

SEPARATOR = " · "
"""Separator between the items of a line."""
LONGEST_STEP = 0.5
"""Distance that no robot drives in one step (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One moment of an episode: the true state and the mapper's.

    A frame holds the truth, so it is for people and files, never for agents. It does not depend on
    a renderer: `scene.lay_out` turns it into shapes and lines of text, which renderers draw.
    """

    environment: str
    """Id of the environment: the task."""
    agent: str = ""
    """Name of the agent; empty if unknown."""
    world: str
    """Name of the world."""
    mapper: str
    """Name of the mapper."""
    robot_radius: float
    """Radius of the robot's body (m)."""
    steps: int
    """Number of steps taken."""
    time: float
    """Simulated time since the start (s)."""
    path_length: float
    """True path length, with the way out (m)."""
    way_out_length: float = 0.0
    """True length of the way that led to where the episode began (m); 0 where that was home."""
    way_out: Float64[np.ndarray, "points 2"] = field(default_factory=lambda: np.empty((0, 2)))
    """True positions on that way, world frame."""
    updates: int
    """Number of readings that the mapper has added to its map."""
    walls: Float64[np.ndarray, "walls 4"]
    """The world's walls, world frame."""
    dynamic_obstacles: Float64[np.ndarray, "obstacles 4"]
    """Outlines of the dynamic obstacles around the robot, world frame."""
    start: Pose
    """True start pose, world frame."""
    pose: Pose
    """True pose, world frame."""
    path: Float64[np.ndarray, "steps 2"]
    """True path, world frame."""
    hits: Float64[np.ndarray, "hits 2"]
    """Points hit by the laser, in the robot's frame."""
    snapshot: MapSnapshot
    """The mapper's map, map frame."""
    belief: Pose
    """Believed pose, map frame."""
    believed_path: Float64[np.ndarray, "beliefs 2"]
    """Believed positions at each moment, map frame."""
    home: Pose
    """Believed pose of home, in the robot's present frame."""
    localised: bool | None = None
    """Whether the robot is localised in a saved map; None if it has made its own."""
    activity: Activity | None = None
    """The activity of the mapper's attractor network; None if it has none."""
    packets: Float64[np.ndarray, "packets 2"] = field(default_factory=lambda: np.empty((0, 2)))
    """Path of the network's largest activity packet, in the network's plane (m)."""
    terms: Mapping[str, float] = field(default_factory=dict)
    """Sum of each term of the reward so far."""
    answer: int | None = None
    """The agent's latest answer on a guided tour (see `is_led`): the number of an earlier stop, or
    0 for none."""

    @property
    def driven(self) -> float:
        """True length of the path since the episode began (m)."""
        return self.path_length - self.way_out_length

    @property
    def position_error(self) -> float:
        """Distance between believed and true position, aligned at the start (m)."""
        cos, sin = math.cos(self.start[2]), math.sin(self.start[2])
        x, y = transform_point(self.start, cos, sin, self.belief[0], self.belief[1])
        return length_of(x - self.pose[0], y - self.pose[1])

    @property
    def is_led(self) -> bool:
        """Whether the robot is on a guided tour, of which only the stops are shown."""
        return bool((np.hypot(*np.diff(self.path, axis=0).T) > LONGEST_STEP).any())

    @property
    def heading(self) -> str:
        """The constant facts: task, agent, world and mapper."""
        agent = f"agent {self.agent}" if self.agent else ""
        parts = (self.environment, agent, f"world {self.world}", f"mapper {self.mapper}")
        return _joined(parts)

    @property
    def figures(self) -> str:
        """The numbers of this moment."""
        parts = (
            clock_time(self.time),
            lengths_text(self.driven, self.way_out_length),
            f"{self.updates} updates",
            *(layer_summary(layer) for layer in self.snapshot.layers),
            f"{self.position_error:.2f} m off",
            "lost" if self.localised is False else "",
        )
        return _joined(parts)

    @property
    def rewards(self) -> str:
        """The reward so far by its terms, and the latest answer."""
        known = {name: value for name, value in self.terms.items() if abs(value) >= 0.005}
        parts = [f"reward {sum(self.terms.values()):.2f}"]
        parts += [f"{name.replace('_', ' ')} {value:.2f}" for name, value in known.items()]
        if self.is_led and self.answer is not None:
            # The first step judges the second stop; the first stop is not judged.
            what = f"as stop {self.answer}" if self.answer else "new"
            parts.insert(0, f"stop {self.steps + 1}: {what}")
        return _joined(parts)


def lengths_text(driven: float, way_out: float) -> str:
    """Return how far a robot has driven in the episode, and on the way out before it (m)."""
    return f"{driven:.1f} m driven" + (f" after {way_out:.1f} m on the way out" if way_out else "")


def clock_time(seconds: float) -> str:
    """Return a time as minutes and seconds, such as 1:23.2."""
    minutes, rest = divmod(round(seconds * 10), 600)
    return f"{minutes}:{rest / 10:04.1f}"


def _joined(parts: Iterable[str]) -> str:
    return SEPARATOR.join(part for part in parts if part)
