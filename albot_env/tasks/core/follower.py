"""The follower: takes down an episode as it runs, for pictures and recordings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import inf
from typing import Any, cast

import numpy as np
from gymnasium.envs.registration import EnvSpec

from albot_core.errors import InputError
from albot_core.maps.activity import Activity
from albot_env.recording.episode import EpisodeHeader, Fact, Moment, NullRecorder, Recorder
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace
from albot_env.tasks.core.interface import TaskInterface
from albot_env.tasks.core.spec import ConfiguredSpec

_CONFIDENCE = "confidence"
"""The part of observations that tells how sure the robot is of home."""
_FIELDS = ("collided", "path_length", "time", "updates")
"""Facts that a moment has fields for."""


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

    def begin(self, seed: int | None, spec: EnvSpec | None) -> None:
        """Begin to follow an episode, from its present state.

        Args:
            seed: Seed of the reset; None if none was given.
            spec: The environment's spec; None if gymnasium did not make it.
        """
        self._map_version, self._activity = -1, None
        header, moment = self._header(seed, spec), self._moment(None)
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
            facts=self._facts(),
            snapshot=robots.snapshot(row) if changed else None,
            activity=None if activity is before else activity,
            dynamic_obstacles=robots.dynamic_obstacles(row),
        )

    def _facts(self) -> dict[str, Fact]:
        """Return what the info says that a moment has no field for; and the observed confidence."""
        robots = self._interface.robots
        facts = {
            name: fact.item(self._row)
            for name, fact in robots.facts.items()
            if fact.ndim == 1 and name not in _FIELDS
        }
        if _CONFIDENCE in robots.observation_config.parts:
            seen = robots.observation_config.split(robots.observations[self._row])
            facts[_CONFIDENCE] = float(seen[_CONFIDENCE][0])
        # JSON has no infinity.
        infinite = [name for name, fact in facts.items() if fact in (inf, -inf) or fact != fact]
        return {**facts, **dict.fromkeys(infinite)}

    def _header(self, seed: int | None, spec: EnvSpec | None) -> EpisodeHeader:
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
            spec=_plain(spec),
            laser=config.laser,
            sonar=config.sonar,
            agent=self.agent,
            way_out=robots.way_out(row),
        )


def _plain(spec: EnvSpec | None) -> Mapping[str, Any] | None:
    """Return a spec as plain data; None if there is none, or if JSON cannot hold it."""
    if spec is None:
        return None
    try:
        return cast("Mapping[str, Any]", json.loads(ConfiguredSpec.of(spec).to_json()))
    except InputError:
        return None


def painted(frame: Frame) -> np.ndarray:
    """Return a frame as an image, (height, width, 3) uint8."""
    from albot_env.rendering.canvas import paint_array
    from albot_env.rendering.scene import lay_out

    return paint_array(lay_out(frame))
