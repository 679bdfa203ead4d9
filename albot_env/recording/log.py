"""An episode as a robot's log, so that other mappers can be led through it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Ranges
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.reader import EpisodeReader


class EpisodeLog:
    """A recorder that keeps what the robot sensed, and where it truly was, in memory."""

    def __init__(self) -> None:
        self._moments: list[Moment] = []

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode, and forget the one before."""
        self._header = header
        self._moments.clear()

    def add(self, moment: Moment) -> None:
        """Keep the next moment."""
        self._moments.append(moment)

    def close(self) -> None:
        """Do nothing."""

    def log(self, name: str) -> Log:
        """The episode so far as a log (see `log_of_moments`)."""
        return log_of_moments(name, self._header, self._moments)


EPISODE_SUFFIX = ".mcap"
"""How the names of episodes' files end."""


def read_log_or_episode(path: Path, keep_going: bool = False) -> Log:
    """A real robot's log, or a recorded episode as one where the file's name ends in `.mcap`.

    Args:
        path: The file.
        keep_going: Whether the good beginning of a damaged log is taken.

    Raises:
        InputError: As `read_log` and `read_episode_log`.
    """
    return read_episode_log(path) if path.suffix == EPISODE_SUFFIX else read_log(path, keep_going)


def read_episode_log(path: Path) -> Log:
    """The log of a recorded episode; of one that was never closed, of its good beginning.

    Raises:
        InputError: There is no such file, it is no episode, or it is damaged before its end.
    """
    reader = EpisodeReader(path)
    return log_of_moments(path.name, reader.header, reader.moments())


def log_of_moments(name: str, header: EpisodeHeader, moments: Iterable[Moment]) -> Log:
    """The log of an episode. Its reference is where the robot truly was (world frame).

    Args:
        name: What the log is called.
        header: What does not change in the episode.
        moments: What happened in it.

    Raises:
        InputError: There is no moment.
    """
    stamps: list[float] = []
    scenes: list[int] = []
    odometry: list[Pose] = []
    poses: list[Pose] = []
    ranges: list[Ranges] = []
    echoes: list[Ranges] = []
    for moment in moments:
        reading = moment.reading
        here = compose(odometry[-1], reading.motion) if odometry else np.zeros(3)
        odometry.append(here)
        stamps.append(reading.stamp)
        poses.append(moment.pose)
        scenes.append(-1 if reading.scene is None else reading.scene)
        if reading.laser is not None:
            ranges.append(reading.laser.ranges)
        if reading.sonar is not None:
            echoes.append(reading.sonar.ranges)
    if not stamps:
        raise InputError(name, "an episode with at least one step", "its header alone")
    return Log(
        name=name,
        geometry=header.laser,
        stamps=np.array(stamps),
        ranges=None if header.laser is None else np.stack(ranges),
        odometry=np.stack(odometry),
        sonar=header.sonar,
        echoes=None if header.sonar is None else np.stack(echoes),
        scenes=np.array(scenes) if max(scenes) >= 0 else None,
        reference=np.stack(poses),
    )
