"""An environment with one robot: what all tasks have in common."""

from __future__ import annotations

from typing import Any, Generic, NoReturn, Unpack

import gymnasium
import numpy as np
from jaxtyping import UInt8

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.maps.activity import Activity
from albot_env.recording.episode import EpisodeHeader, Moment, NullRecorder, Recorder
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace
from albot_env.rendering.viewer import NullViewer, Viewer
from albot_env.tasks.core.interface import (
    CLOSED,
    METADATA,
    NOT_COPIED,
    Observation,
    Robots,
    TaskInterface,
)
from albot_env.tasks.core.journeys import Journeys
from albot_env.tasks.core.settings import (
    DEFAULT_WORLD,
    Settings,
    Worlds,
    check_seed,
    check_settings,
    choose_start,
    choose_world,
    settings_of,
)
from albot_maps import load_worlds


class SingleEnv(gymnasium.Env[Any, Any], Generic[Robots]):
    """One robot with a task. A task's environment names its class, and is documented there.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        render_mode: `human`, `rgb_array` or None.
        settings: See `Settings`.

    Raises:
        InputError: There is no such setting, world, mapper, sensor, observation or render mode;
            or `human` where no window opens.
    """

    metadata = METADATA
    task: type[Robots]
    """The task's class."""

    def __init__(
        self,
        world: Worlds = DEFAULT_WORLD,
        *,
        render_mode: str | None = None,
        **settings: Unpack[Settings],
    ) -> None:
        self._environment = environment = self.task.environment
        check_settings(settings, self.settings(), environment)
        self._worlds = load_worlds(world)
        self._interface = interface = TaskInterface(self.task, 1, **settings)
        self._robot: Robots = interface.robots
        self.render_mode = render_mode
        self._viewer = _open_viewer(render_mode, environment)
        self.observation_config = interface.observation_config
        """How observations are made of readings, with the sensors chosen."""
        self.action_space = interface.action_space
        self.observation_space = interface.observation_space
        self._map_version = -1
        self._activity: Activity | None = None
        self._begun = self._closed = False
        self._trace: Trace | None = None
        self.recorder: Recorder = NullRecorder()
        """Records the episodes from the next reset on."""
        self.agent = ""
        """Name of the agent that acts, for recordings and pictures from the next reset on."""

    @classmethod
    def settings(cls) -> dict[str, Any]:
        """What it takes by name: types by name."""
        return settings_of(cls.__init__, cls.task)

    def reset(
        self, *, seed: int | np.integer | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new episode.

        Raises:
            InputError: An option is unknown, or the start or the seed is not valid.
            ClosedEnvironmentError: It has been closed.
        """
        self._check_open()
        seed = None if seed is None else check_seed(seed, self._environment)
        super().reset(seed=seed)
        world = choose_world(self._worlds, self.np_random, options or {}, self._environment)
        start = choose_start(world, self.np_random, options or {}, self._environment)
        self._robot.check_start(world, start)
        self._robot.begin(0, world, start, self.np_random)
        self._robot.detach_observations()
        self._robot.observe()
        self._map_version = -1
        self._activity = None
        self._begun = True
        self._trace = None
        if self._followed:
            header, moment = self._header(start, seed), self._moment(None)
            self._trace = Trace(header, moment)
            self.recorder.begin(header)
            self.recorder.add(moment)
            self._show()
        return self._interface.shown(self._robot.observations[0]), self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s.

        Raises:
            InputError: The action has another shape, or is not finite.
            ResetNeeded: There was no reset before.
            ClosedEnvironmentError: It has been closed.
        """
        self._check_open()
        if not self._begun:
            raise gymnasium.error.ResetNeeded(f"{self._environment}: reset before the first step")
        robot = self._robot
        self._interface.act_single(action)
        robot.observe()
        if self._trace is not None:
            moment = self._moment(np.atleast_1d(np.array(action, np.float64)))
            self._trace.add(moment)
            self.recorder.add(moment)
            self._show()
        reward, ended = float(robot.rewards[0]), bool(robot.ended[0])
        return (
            self._interface.shown(self._robot.observations[0]),
            reward,
            ended,
            False,
            self._info(),
        )

    @property
    def journeys(self) -> Journeys[Any] | None:
        """What the robot has behind it when an episode begins; None where it sets out anew."""
        return self._robot.journeys

    @property
    def frame(self) -> Frame:
        """The present moment to be drawn. It holds the truth: for people, not for agents.

        Raises:
            ResetNeeded: There was no reset since the environment has a render mode or a
                recorder, without which nobody follows the robot.
        """
        if self._trace is None:
            wanted = "reset with a render mode or a recorder before the first frame"
            raise gymnasium.error.ResetNeeded(f"{self._environment}: {wanted}")
        return self._trace.frame

    def render(self) -> UInt8[np.ndarray, "h w 3"] | None:
        """The present moment as an image in `rgb_array` mode; `human` shows every step anyway."""
        if self.render_mode != "rgb_array":
            return None
        from albot_env.rendering.canvas import paint_array
        from albot_env.rendering.scene import lay_out

        return paint_array(lay_out(self.frame))

    def close(self) -> None:
        """Close the window and the recording; nothing can be done with it any more."""
        self._closed = True
        self._viewer.close()
        self.recorder.close()
        self._robot.close()

    def __getstate__(self) -> NoReturn:
        """Raise TypeError: an environment can be neither copied nor pickled."""
        raise TypeError(NOT_COPIED.format(self._environment))

    def _check_open(self) -> None:
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError(CLOSED.format(self._environment))

    @property
    def _followed(self) -> bool:
        """Whether somebody wants to know how each step went."""
        return self.render_mode is not None or not isinstance(self.recorder, NullRecorder)

    def _moment(self, action: np.ndarray | None) -> Moment:
        """State of the episode after a reading."""
        robot = self._robot
        version, matched = int(robot.map_versions[0]), robot.matched_reading(0)
        changed, self._map_version = version != self._map_version, version
        activity, before = robot.activity(0), self._activity
        self._activity = activity
        return Moment(
            action=action,
            reward=float(robot.rewards[0]),
            terms=robot.terms_of(0),
            reading=robot.readings[0],
            pose=robot.poses[0].copy(),
            collided=bool(robot.collided[0]),
            room=robot.room(0),
            path_length=float(robot.path_lengths[0]),
            belief=robot.beliefs[0].copy(),
            home=robot.homes[0].copy(),
            updates=int(robot.updates[0]),
            matched_reading=None if matched < 0 else matched,
            snapshot=robot.snapshot(0) if changed else None,
            activity=None if activity is before else activity,
            dynamic_obstacles=robot.dynamic_obstacles(0),
        )

    def _info(self) -> dict[str, Any]:
        robot = self._robot
        return {
            "reward_terms": robot.terms_of(0),
            "world": robot.world(0).name,
            "room": robot.room(0),
            **{name: _single(fact) for name, fact in robot.facts.items()},
        }

    def _header(self, start: Pose, seed: int | None) -> EpisodeHeader:
        world = self._robot.world(0)
        return EpisodeHeader(
            environment=self._environment,
            world=world.name,
            walls=world.walls,
            start=start.copy(),
            mapper=self._interface.mapper,
            odometer=self._interface.odometer,
            seed=seed,
            laser=self._robot.observation_config.laser,
            sonar=self._robot.observation_config.sonar,
            agent=self.agent,
        )

    def _show(self) -> None:
        if self.render_mode == "human":
            self._viewer.show(self.frame)


def _single(fact: Any) -> Any:
    """One robot's row of a fact: a copy of an array, or a number of Python's own."""
    return fact[0].copy() if fact.ndim > 1 else fact.item(0)


def _open_viewer(render_mode: str | None, environment: str) -> Viewer:
    if render_mode == "human":
        from albot_env.rendering.window import Window

        return Window(environment)
    if render_mode not in (None, "rgb_array"):
        raise InputError(environment, "human, rgb_array or None", render_mode, place="render_mode")
    return NullViewer()
