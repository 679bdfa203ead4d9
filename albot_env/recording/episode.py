"""An episode as data: a header, followed by moments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points, Pose, Segments
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import LaserGeometry, Reading, SonarGeometry

Fact = bool | int | float | str | None
"""What an info says of a moment; None for a number that is not finite."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeHeader:
    """The constant data of an episode."""

    environment: str
    """Id of the environment."""
    world: str
    """Name of the world."""
    walls: Segments
    """The world's walls, world frame."""
    start: Pose
    """True start pose, world frame: the origin of the map frame."""
    mapper: str
    """Name of the mapper."""
    odometer: str
    """Name of the odometer's preset."""
    robot_radius: float
    """Radius of the robot's body (m)."""
    seed: int | None
    """Seed of the reset; None if none was given."""
    agent: str = ""
    """Name of the agent; empty if unknown."""
    laser: LaserGeometry | None = None
    """Geometry of the laser's beams; None on a robot without a laser."""
    sonar: SonarGeometry | None = None
    """Geometry of the sonars; None on a robot without sonars."""
    spec: Mapping[str, Any] | None = None
    """The environment's spec as JSON has it (`EnvSpec.to_json`), by which gymnasium makes it
    again; None if it was made otherwise, or if JSON cannot hold one of its settings."""
    way_out: Points = field(default_factory=lambda: np.empty((0, 2)))
    """True path that led the robot to where the episode begins, world frame (m); empty where it
    begins at home."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """The events of one step, and the state after it.

    The first moment of an episode is the state after the reset.
    """

    action: Float64[np.ndarray, "numbers"] | None
    """The agent's action as given; None in the first moment."""
    reward: float
    """The sum of the terms."""
    terms: Mapping[str, float]
    """The reward's terms by name."""
    reading: Reading
    """The sensor readings."""
    pose: Pose
    """True pose, world frame."""
    collided: bool
    """Whether the robot touched something."""
    room: str
    """Name of the room that the robot is truly in; empty between rooms."""
    path_length: float
    """True path length since the start (m)."""
    belief: Pose
    """Believed pose, map frame."""
    home: Pose
    """Believed pose of home, in the robot's present frame."""
    updates: int
    """Number of readings that the mapper has added to its map."""
    matched_reading: int | None
    """Index, from 0, of the earlier reading that the mapper matches with the present place; None
    for no match."""
    snapshot: MapSnapshot | None
    """The map, map frame; None if unchanged since the previous moment."""
    activity: Activity | None = None
    """The activity of the mapper's attractor network; None if unchanged since the previous moment,
    or if the mapper has no network."""
    facts: Mapping[str, Fact] = field(default_factory=dict)
    """What the task's info says at this moment, by name, without what other fields hold; and
    `confidence`, the part of observations, if the robot observes it."""
    dynamic_obstacles: Float64[np.ndarray, "obstacles 4"] = field(
        default_factory=lambda: np.empty((0, 4))
    )
    """Current outlines of the dynamic obstacles around the robot, world frame."""


@runtime_checkable
class Recorder(Protocol):
    """Records an episode, moment by moment."""

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode."""

    def add(self, moment: Moment) -> None:
        """Record the next moment."""

    def close(self) -> None:
        """End the episode; a second call does nothing."""


class NullRecorder:
    """Records nothing."""

    def begin(self, header: EpisodeHeader) -> None:
        """Do nothing."""

    def add(self, moment: Moment) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


class FirstEpisode:
    """Passes the first episode on to a recorder, and ignores those that follow.

    A batch begins another episode wherever one is over, but a file holds one.

    Args:
        recorder: Records the first episode.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder, self._episodes = recorder, 0

    def begin(self, header: EpisodeHeader) -> None:
        """Begin the first episode; at the next one, end it."""
        self._episodes += 1
        if self._episodes == 1:
            self._recorder.begin(header)
        elif self._episodes == 2:
            self._recorder.close()

    def add(self, moment: Moment) -> None:
        """Record the next moment of the first episode."""
        if self._episodes == 1:
            self._recorder.add(moment)

    def close(self) -> None:
        """End the episode; a second call does nothing."""
        self._recorder.close()
