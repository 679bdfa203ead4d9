"""The frame: everything that can be drawn of one moment of an episode."""

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
"""What parts the items of a line."""
LONGEST_STEP = 0.5
"""No robot drives as far in one step (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One moment of an episode: the truth beside what the mapper makes of it.

    A frame holds the truth, so it is for people and files, never for agents. It knows nothing of
    screens: `scene.lay_out` makes shapes and lines of text of it, and each renderer draws those.
    """

    environment: str
    """Id of the environment: the task."""
    agent: str = ""
    """Name of the agent; empty where nobody has said."""
    world: str
    """Name of the world."""
    mapper: str
    """Name of the mapper."""
    steps: int
    """How many steps were taken."""
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
    activity: Activity | None = None
    """The activity of the mapper's attractor network; None where it has none."""
    packets: Float64[np.ndarray, "packets 2"] = field(default_factory=lambda: np.empty((0, 2)))
    """Where the network's largest packet has been, in its own plane (m)."""
    terms: Mapping[str, float] = field(default_factory=dict)
    """What each term of the reward has come to so far."""
    answer: int | None = None
    """The agent's latest answer, where it is led from stop to stop (see `is_led`): the number of an
    earlier stop, or 0 for none."""

    @property
    def position_error(self) -> float:
        """Distance between the believed and the true position, aligned at the start (m)."""
        cos, sin = math.cos(self.start[2]), math.sin(self.start[2])
        x, y = transform_point(self.start, cos, sin, self.belief[0], self.belief[1])
        return length_of(x - self.pose[0], y - self.pose[1])

    @property
    def is_led(self) -> bool:
        """Whether the robot is led from stop to stop, and seen at the stops alone."""
        return bool((np.hypot(*np.diff(self.path, axis=0).T) > LONGEST_STEP).any())

    @property
    def heading(self) -> str:
        """What does not change: the task, who drives where, and with which mapper."""
        agent = f"agent {self.agent}" if self.agent else ""
        parts = (self.environment, agent, f"world {self.world}", f"mapper {self.mapper}")
        return _joined(parts)

    @property
    def figures(self) -> str:
        """The figures of this moment."""
        parts = (
            clock_time(self.time),
            f"{self.path_length:.1f} m driven",
            f"{self.updates} updates",
            *(layer_summary(layer) for layer in self.snapshot.layers),
            f"{self.position_error:.2f} m off",
        )
        return _joined(parts)

    @property
    def rewards(self) -> str:
        """What the reward has come to, by its terms; and what was answered last."""
        known = {name: value for name, value in self.terms.items() if abs(value) >= 0.005}
        parts = [f"reward {sum(self.terms.values()):.2f}"]
        parts += [f"{name.replace('_', ' ')} {value:.2f}" for name, value in known.items()]
        if self.is_led and self.answer is not None:
            # The first step judges the second stop: of the first nothing is asked.
            what = f"as stop {self.answer}" if self.answer else "new"
            parts.insert(0, f"stop {self.steps + 1}: {what}")
        return _joined(parts)


def clock_time(seconds: float) -> str:
    """A time as minutes and seconds, as 1:23.2."""
    minutes, rest = divmod(round(seconds * 10), 600)
    return f"{minutes}:{rest / 10:04.1f}"


def _joined(parts: Iterable[str]) -> str:
    return SEPARATOR.join(part for part in parts if part)
