"""The follower: takes down an episode as it runs, for pictures and recordings."""

from __future__ import annotations

from typing import Any

import numpy as np

from albot_core.maps.activity import Activity
from albot_env.recording.episode import EpisodeHeader, Moment, NullRecorder, Recorder
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace
from albot_env.tasks.core.interface import TaskInterface


class EpisodeFollower:
    """Follows the episodes of one robot.

    Args:
        interface: The robots and their settings.
        row: The robot.
    """

    def __init__(self, interface: TaskInterface[Any], row: int) -> None:
        self._interface = interface
        self._row = row
        self._map_version = -1
        self._activity: Activity | None = None
        self._trace: Trace | None = None
        self.recorder: Recorder = NullRecorder()
        """Records the episodes from the next `begin` on."""
        self.agent = ""
        """Name of the agent that acts, for recordings and pictures from the next `begin` on."""

    @property
    def records(self) -> bool:
        """Whether the episodes are recorded."""
        return not isinstance(self.recorder, NullRecorder)

    @property
    def frame(self) -> Frame | None:
        """The present moment to be drawn; None if nobody has followed the episode."""
        return None if self._trace is None else self._trace.frame

    def forget(self) -> None:
        """Follow the episode no more, until the next `begin`."""
        self._trace = None

    def begin(self, seed: int | None) -> None:
        """Begin to follow an episode, from its present state."""
        self._map_version, self._activity = -1, None
        header, moment = self._header(seed), self._moment(None)
        self.recorder.begin(header)
        self._trace = Trace(header, moment)
        self.recorder.add(moment)

    def add(self, action: Any) -> None:
        """Take down a step, if the episode is followed."""
        if self._trace is not None:
            moment = self._moment(np.atleast_1d(np.array(action, np.float64)))
            self._trace.add(moment)
            self.recorder.add(moment)

    def _moment(self, action: np.ndarray | None) -> Moment:
        """Return the state of the episode after a reading."""
        robots, row = self._interface.robots, self._row
        version, matched = int(robots.map_versions[row]), robots.matched_reading(row)
        changed, self._map_version = version != self._map_version, version
        activity, before = robots.activity(row), self._activity
        self._activity = activity
        return Moment(
            action=action,
            reward=float(robots.rewards[row]),
            terms=robots.terms_of(row),
            reading=robots.readings[row],
            pose=robots.poses[row].copy(),
            collided=bool(robots.collided[row]),
            room=robots.room(row),
            path_length=float(robots.path_lengths[row]),
            belief=robots.beliefs[row].copy(),
            home=robots.homes_in_robot[row].copy(),
            updates=int(robots.updates[row]),
            matched_reading=None if matched < 0 else matched,
            snapshot=robots.snapshot(row) if changed else None,
            activity=None if activity is before else activity,
            dynamic_obstacles=robots.dynamic_obstacles(row),
        )

    def _header(self, seed: int | None) -> EpisodeHeader:
        robots, row = self._interface.robots, self._row
        world, config = robots.world(row), robots.observation_config
        return EpisodeHeader(
            environment=self._interface.environment,
            world=world.name,
            walls=world.walls,
            start=robots.starts[row].copy(),
            mapper=self._interface.mapper,
            odometer=self._interface.odometer,
            robot_radius=self._interface.robot_config.radius,
            seed=seed,
            laser=config.laser,
            sonar=config.sonar,
            agent=self.agent,
            way_out=robots.way_out(row),
        )


def painted(frame: Frame) -> np.ndarray:
    """Return a frame as an image, (height, width, 3) uint8."""
    from albot_env.rendering.canvas import paint_array
    from albot_env.rendering.scene import lay_out

    return paint_array(lay_out(frame))
