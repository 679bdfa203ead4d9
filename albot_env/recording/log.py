"""Conversion of an episode to a robot's log, on which other mappers can be run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Ranges
from albot_core.logs.log import Log, Unread
from albot_core.logs.reader import read_log
from albot_core.logs.ros_bag import BagTopics
from albot_core.ros.bag import is_bag
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.reader import EpisodeReader


class EpisodeLog:
    """A recorder that keeps readings and true poses in memory."""

    def __init__(self) -> None:
        self._moments: list[Moment] = []

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode; the previous one is dropped."""
        self._header = header
        self._moments.clear()

    def add(self, moment: Moment) -> None:
        """Store the next moment."""
        self._moments.append(moment)

    def close(self) -> None:
        """Do nothing."""

    def log(self, name: str) -> Log:
        """Return the episode so far as a log (see `log_of_moments`)."""
        return log_of_moments(name, self._header, self._moments)


EPISODE_SUFFIX = ".mcap"
"""File name suffix of episodes."""


def read_log_or_episode(
    path: Path, keep_going: bool = False, topics: BagTopics | None = None
) -> Log:
    """Read a real robot's log, or a recorded episode.

    A file whose name ends in `.mcap` is an episode, unless it holds messages of ROS.

    Args:
        path: The file, or the folder of a ROS bag.
        keep_going: Whether to leave out the damaged lines of a log.
        topics: The topics of a ROS bag that are read.

    Raises:
        InputError: As `read_log` and `read_episode_log`; or topics of an episode are asked for.
    """
    if path.suffix.lower() != EPISODE_SUFFIX or is_bag(path):
        return read_log(path, keep_going, topics)
    log = read_episode_log(path)
    if topics is not None:
        raise InputError(path, "a ROS bag, as topics are given", "a recorded episode")
    return log


def read_episode_log(path: Path) -> Log:
    """Return the log of a recorded episode; if the file was never closed, of its intact part.

    The log's `unread` then says so.

    Raises:
        InputError: The file does not exist, is no episode, or is damaged before its end.
    """
    reader = EpisodeReader(path)
    log = log_of_moments(path.name, reader.header, reader.moments())
    if not reader.torn:
        return log
    until = f"read up to its last complete chunk, at {log.stamps[-1]:.1f} s"
    reason = f"{path.name}: never closed, ends early; {until}"
    return replace(log, unread=Unread(lines=0, scans=0, where="", reason=reason))


def log_of_moments(name: str, header: EpisodeHeader, moments: Iterable[Moment]) -> Log:
    """Return the log of an episode. Its reference trajectory is the true one (world frame).

    Args:
        name: Name of the log.
        header: Header of the episode.
        moments: Moments of the episode.

    Raises:
        InputError: There are no moments.
    """
    stamps: list[float] = []
    scenes: list[int] = []
    compasses: list[float | None] = []
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
        compasses.append(reading.compass)
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
        compasses=None if None in compasses else np.array(compasses, np.float64),
        reference=np.stack(poses),
    )
