"""An environment with one robot: what all tasks have in common."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

import gymnasium
import numpy as np
from jaxtyping import Float32, UInt8

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_env.recording.episode import EpisodeHeader, Moment, NullRecorder, Recorder
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace
from albot_env.rendering.viewer import NullViewer, Viewer
from albot_env.tasks.core.journeys import Journeys
from albot_env.tasks.core.observation import Parts
from albot_env.tasks.core.robots import Expedition
from albot_env.tasks.core.settings import Equipment, Settings, equip, wants_discrete, wants_flat
from albot_env.tasks.core.start import choose_start, choose_world
from albot_maps import World, WorldSet, load_worlds

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}

Observation = Float32[np.ndarray, "length"] | Parts
Robots = TypeVar("Robots", bound=Expedition)


class SingleSettings(Settings, total=False):
    """What every single environment takes by name."""

    render_mode: str | None
    """`human`, `rgb_array` or None."""


class SingleEnv(gymnasium.Env[Any, Any], Generic[Robots]):
    """One robot on an expedition.

    Args:
        gather: Makes the expedition of so many robots with this equipment.
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        mapper, odometer, laser, sonar, scenes, observation, action, movables: See `Settings`.
        render_mode: See `SingleSettings`.

    Raises:
        InputError: There is no such world, mapper, sensor, observation or render mode; or
            `human` where no window opens.
    """

    metadata = METADATA

    def __init__(
        self,
        gather: Callable[[int, Equipment], Robots],
        world: str | Path | World | WorldSet,
        *,
        mapper: str = "albot1",
        odometer: str = "pioneer",
        laser: str = "lms-200",
        sonar: str = "pioneer",
        scenes: str = "none",
        observation: str = "flat",
        action: str = "continuous",
        movables: bool = True,
        render_mode: str | None = None,
    ) -> None:
        self._worlds = load_worlds(world)
        self._odometer = odometer
        equipment = equip(
            mapper=mapper,
            odometer=odometer,
            laser=laser,
            sonar=sonar,
            scenes=scenes,
            movables=movables,
        )
        self._robot = gather(1, equipment)
        self._task = task = self._robot.task
        self.render_mode = render_mode
        self._viewer = _open_viewer(render_mode, task)
        self._mapper_name = mapper
        self._flat = wants_flat(observation, task)
        self.observing = scaling = self._robot.observing
        """How observations are made of readings, with the sensors chosen."""
        actions = self._robot.actions
        self._discrete = wants_discrete(action, task)
        self.action_space = actions.choice_space if self._discrete else actions.space
        self.observation_space = scaling.flat_space if self._flat else scaling.dict_space
        self._map_version = -1
        self._begun = False
        self._trace: Trace | None = None
        self.recorder: Recorder = NullRecorder()
        """Takes the episodes down from the next reset on."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new episode.

        Raises:
            InputError: An option is unknown, or the start is none.
        """
        super().reset(seed=seed)
        world = choose_world(self._worlds, self.np_random, options or {}, self._task)
        start = choose_start(world, self.np_random, options or {}, self._task)
        self._robot.check_start(world, start)
        self._robot.begin(0, world, start, self.np_random)
        self._robot.turn_page()
        self._robot.look()
        self._map_version = -1
        self._begun = True
        self._trace = None
        if self._followed:
            header, moment = self._header(start, seed), self._moment(None)
            self._trace = Trace(header, moment)
            self.recorder.begin(header)
            self.recorder.add(moment)
            self._show()
        return self._observe(), self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s.

        Raises:
            InputError: The action is not in the action space.
        """
        if not self._begun:
            raise gymnasium.error.ResetNeeded(f"{self._task}: reset before the first step")
        robot = self._robot
        if self._discrete:
            action = robot.actions.chosen(action, None, self._task)
        robot.act(robot.actions.single(action, self._task))
        robot.look()
        if self._trace is not None:
            moment = self._moment(np.atleast_1d(np.array(action, np.float64)))
            self._trace.add(moment)
            self.recorder.add(moment)
            self._show()
        reward, ended = float(robot.rewards[0]), bool(robot.ended[0])
        return self._observe(), reward, ended, False, self._info()

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
            raise gymnasium.error.ResetNeeded(
                f"{self._task}: reset with a render mode or a recorder before the first frame"
            )
        return self._trace.frame

    def render(self) -> UInt8[np.ndarray, "h w 3"] | None:
        """The present moment as an image in `rgb_array` mode; `human` shows every step anyway."""
        if self.render_mode != "rgb_array":
            return None
        from albot_env.rendering.canvas import paint_array
        from albot_env.rendering.scene import lay_out

        return paint_array(lay_out(self.frame))

    def close(self) -> None:
        """Close the window and the recording."""
        self._viewer.close()
        self.recorder.close()
        self._robot.close()

    @property
    def _followed(self) -> bool:
        """Whether somebody wants to know how each step went."""
        return self.render_mode is not None or not isinstance(self.recorder, NullRecorder)

    def _moment(self, action: np.ndarray | None) -> Moment:
        """How things stand after a reading."""
        robot = self._robot
        version, matched = int(robot.map_versions[0]), int(robot.matched_readings[0])
        changed, self._map_version = version != self._map_version, version
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
            things=robot.things(0),
        )

    def _observe(self) -> Observation:
        row = self._robot.observations[0]
        return row if self._flat else self.observing.split(row)

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
            environment=self._task,
            world=world.name,
            walls=world.walls,
            start=start.copy(),
            mapper=self._mapper_name,
            odometer=self._odometer,
            seed=seed,
            laser=self._robot.geometry,
            sonar=self._robot.sonar,
        )

    def _show(self) -> None:
        if self.render_mode == "human":
            self._viewer.show(self.frame)


def _single(fact: Any) -> Any:
    """One robot's row of a fact: a copy of an array, or a number of Python's own."""
    return fact[0].copy() if fact.ndim > 1 else fact.item(0)


def _open_viewer(render_mode: str | None, task: str) -> Viewer:
    if render_mode == "human":
        from albot_env.rendering.window import Window

        return Window(task)
    if render_mode not in (None, "rgb_array"):
        raise InputError(task, "human, rgb_array or None", render_mode, place="render_mode")
    return NullViewer()
