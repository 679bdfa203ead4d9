"""`Albot/Explore-v0`: cover a building that was never seen before."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float32, UInt8

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_env.recording.episode import EpisodeHeader, Moment, NullRecorder, Recorder
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace
from albot_env.rendering.viewer import NullViewer, Viewer
from albot_env.sim import choose_sensors
from albot_env.sim.simulator import CONTROL_STEP
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.expedition import Expedition
from albot_env.tasks.observation import ObservationConfig, Parts
from albot_env.tasks.reward import ExploreWeights
from albot_env.tasks.start import choose_start, choose_world
from albot_maps import World, WorldSet, load_worlds

ENVIRONMENT = "Albot/Explore-v0"
METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}

Observation = Float32[np.ndarray, "length"] | Parts


@dataclass(frozen=True, kw_only=True)
class ExploreConfig:
    """What actions ask for, how observations are scaled, and what is rewarded."""

    actions: ActionConfig = field(default_factory=ActionConfig)
    """What actions ask for."""
    observations: ObservationConfig = field(default_factory=ObservationConfig)
    """How observations are scaled, and which ground counts as covered."""
    weights: ExploreWeights = field(default_factory=ExploreWeights)
    """What the reward's terms are worth."""


class ExploreEnv(gymnasium.Env[Any, Any]):
    """A robot explores a building with a mapper inside.

    Description:
        A Pioneer 3-DX with a laser, sonars and a noisy odometer sets out with an empty map. It
        is to cover as much ground and enter as many rooms as it can. A step is 0.1 s.

    Action space:
        `Box(-1, 1, (2,), float32)`: speed and turn rate, as shares of `ActionConfig`.
        Anything else, out of range or not a number, is an `InputError`.

    Observation space:
        With `observation="dict"` the parts of `ObservationConfig.observe`, by default
        the same in one row (`ObservationConfig.split` takes it apart). All float32 in
        [-1, 1]. They are a function of the readings alone.

    Rewards:
        The sum of the terms of `ExploreWeights`; each stands in `info["reward_terms"]`.

    Starting state:
        At rest at one of the world's starts, drawn at random;
        `reset(options={"start": k})` sets out from the k-th, `{"start": (x, y, heading)}`
        from a pose. With several worlds (`random:office:0..99`) each reset draws one;
        `{"world": k}` asks for the k-th.

    Episode end:
        Never by itself; truncated after `max_episode_steps` (6000, ten minutes), which
        `gymnasium.make` takes.

    Info:
        The truth, for evaluation: `world` (its name), `pose` and `belief` (m, rad; the
        belief in the map's frame, which lies at the true start), `position_error` (m),
        `room` (empty between rooms), `rooms_entered`, `coverage` (share of the reachable
        ground), `collided`, `path_length` (m), `time` (s), `updates`, `surfaces`,
        `reward_terms`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`).
        mapper: Name of the mapper inside, or `none`: the robot only adds up its odometer.
        odometer: Name of the odometer's preset (`albot_env.sim.ODOMETERS`).
        laser: Name of the laser's preset (`LASERS`).
        sonar: Name of the sonars' preset (`SONARS`), or `none`.
        scenes: Name of the camera's preset (`SCENES`), or `none`. Mappers see its scenes;
            observations do not show them.
        observation: `flat` or `dict`.
        movables: Whether doors, boxes and people move in worlds that have any; if not, they
            are left out.
        render_mode: `human`, `rgb_array` or None.
        config: What actions ask for, how observations are scaled, what is rewarded.

    Raises:
        InputError: There is no such world, mapper, sensor, observation or render mode; or
            `human` where no window opens.
    """

    metadata = METADATA

    def __init__(
        self,
        world: str | World | WorldSet = "office-ring",
        *,
        mapper: str = "albot1",
        odometer: str = "pioneer",
        laser: str = "lms-200",
        sonar: str = "pioneer",
        scenes: str = "none",
        observation: str = "flat",
        movables: bool = True,
        render_mode: str | None = None,
        config: ExploreConfig | None = None,
    ) -> None:
        if observation not in ("flat", "dict"):
            raise InputError(ENVIRONMENT, "flat or dict", str(observation), place="observation")
        self.render_mode = render_mode
        self._viewer = _open_viewer(render_mode)
        self._worlds = load_worlds(world)
        self._config = config = config or ExploreConfig()
        self._odometer = odometer
        sensors = choose_sensors(
            laser=laser, odometer=odometer, sonar=sonar, scenes=scenes, source=ENVIRONMENT
        )
        self._robot = Expedition(
            1, mapper, sensors, config.observations, config.weights, movables=movables
        )
        self.observing = scaling = self._robot.observing
        """How observations are made of readings, with the sensors chosen."""
        self._mapper_name = mapper
        self._flat = observation == "flat"
        self.action_space = config.actions.space
        self.observation_space = scaling.flat_space if self._flat else scaling.dict_space
        self._updates = -1
        self._begun = False
        self._trace: Trace | None = None
        self.recorder: Recorder = NullRecorder()
        """Takes the episodes down from the next reset on."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Set out anew with an empty map.

        Raises:
            InputError: An option is unknown, or the start is none.
        """
        super().reset(seed=seed)
        world = choose_world(self._worlds, self.np_random, options or {}, ENVIRONMENT)
        start = choose_start(world, self.np_random, options or {}, ENVIRONMENT)
        self._robot.check_start(world, start)
        self._robot.begin(0, world, start, self.np_random)
        self._robot.turn_page()
        self._robot.look()
        self._updates = -1
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
            InputError: The action is not two numbers in [-1, 1].
        """
        if not self._begun:
            raise gymnasium.error.ResetNeeded(f"{ENVIRONMENT}: reset before the first step")
        robot = self._robot
        robot.drive(self._config.actions.command(action, ENVIRONMENT))
        robot.look()
        if self._trace is not None:
            moment = self._moment(np.array(action, np.float64))
            self._trace.add(moment)
            self.recorder.add(moment)
            self._show()
        return self._observe(), float(robot.rewards[0]), False, False, self._info()

    @property
    def frame(self) -> Frame:
        """The present moment to be drawn. It holds the truth: for people, not for agents.

        Raises:
            ResetNeeded: There was no reset since the environment has a render mode or a
                recorder, without which nobody follows the robot.
        """
        if self._trace is None:
            raise gymnasium.error.ResetNeeded(
                f"{ENVIRONMENT}: reset with a render mode or a recorder before the first frame"
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
        updates = int(robot.updates[0])
        changed, self._updates = updates != self._updates, updates
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
            updates=updates,
            surfaces=robot.surfaces(0) if changed else None,
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
            "pose": robot.poses[0].copy(),
            "belief": robot.beliefs[0].copy(),
            "position_error": robot.position_errors.item(0),
            "room": robot.room(0),
            "rooms_entered": robot.rooms_entered.item(0),
            "coverage": robot.coverages.item(0),
            "collided": robot.collided.item(0),
            "path_length": robot.path_lengths.item(0),
            "time": robot.steps.item(0) * CONTROL_STEP,
            "updates": robot.updates.item(0),
            "surfaces": robot.surface_counts.item(0),
        }

    def _header(self, start: Pose, seed: int | None) -> EpisodeHeader:
        world = self._robot.world(0)
        return EpisodeHeader(
            environment=ENVIRONMENT,
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


def _open_viewer(render_mode: str | None) -> Viewer:
    if render_mode == "human":
        from albot_env.rendering.window import Window

        return Window(ENVIRONMENT)
    if render_mode not in (None, "rgb_array"):
        raise InputError(ENVIRONMENT, "human, rgb_array or None", render_mode, place="render_mode")
    return NullViewer()
