"""An episode as data: its header, then one moment after another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose, Segments
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import LaserGeometry, Reading, SonarGeometry


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeHeader:
    """What does not change during an episode."""

    environment: str
    """Id of the environment."""
    world: str
    """Name of the world."""
    walls: Segments
    """The world's walls, world frame."""
    start: Pose
    """Where the robot truly sets out, world frame: the origin of the map's frame."""
    mapper: str
    """Name of the mapper."""
    odometer: str
    """Name of the odometer's preset."""
    seed: int | None
    """The seed of the reset; None where it had none."""
    agent: str = ""
    """Name of the agent; empty where nobody has said."""
    laser: LaserGeometry | None = None
    """Where the laser's beams point; None on a robot without a laser."""
    sonar: SonarGeometry | None = None
    """Where the sonars sit and point; None on a robot without sonars."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """What happened in one step, and how things stand after it.

    The first moment of an episode is how things stand after the reset.
    """

    action: Float64[np.ndarray, "numbers"] | None
    """The agent's action as it gave it; None in the first moment."""
    reward: float
    """The sum of the terms."""
    terms: Mapping[str, float]
    """The reward's terms by name."""
    reading: Reading
    """What the robot sensed."""
    pose: Pose
    """Where the robot truly is, world frame."""
    collided: bool
    """Whether the robot touched something."""
    room: str
    """Name of the room that the robot is truly in; empty between rooms."""
    path_length: float
    """Distance truly driven since the start (m)."""
    belief: Pose
    """Where the robot believes to be, map frame."""
    home: Pose
    """Where home is believed to be, in the robot's present frame."""
    updates: int
    """How many readings the mapper has added to its map."""
    matched_reading: int | None
    """The earlier reading that the mapper believes was taken at the present place, counted from
    0; None where it recognises nothing."""
    snapshot: MapSnapshot | None
    """The map, map frame; None where it is that of the moment before."""
    activity: Activity | None = None
    """The activity of the mapper's attractor network; None where it is that of the moment before,
    and where the mapper has none."""
    things: Float64[np.ndarray, "things 4"] = field(default_factory=lambda: np.empty((0, 4)))
    """The outlines of what moves around the robot, where it is now, world frame."""


@runtime_checkable
class Recorder(Protocol):
    """Records an episode, moment by moment."""

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode."""

    def add(self, moment: Moment) -> None:
        """Record the next moment."""

    def close(self) -> None:
        """End the episode; may be called again."""


class NullRecorder:
    """Records nothing."""

    def begin(self, header: EpisodeHeader) -> None:
        """Do nothing."""

    def add(self, moment: Moment) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
