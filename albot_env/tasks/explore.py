"""`Albot/Explore-v0`: cover a building that was never seen before."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float32, UInt8

from albot_core.errors import InputError
from albot_core.geometry.types import Segments
from albot_core.perception.reading import Reading
from albot_core.registry import make_mapper
from albot_env.recording.episode import EpisodeHeader, Moment, NullRecorder, Recorder
from albot_env.rendering.frame import Frame, position_error
from albot_env.rendering.trace import Trace
from albot_env.rendering.viewer import NullViewer, Viewer
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.ground import map_coverage, reachable_area, world_coverage
from albot_env.tasks.journey import Journey
from albot_env.tasks.observation import ObservationConfig, Parts
from albot_env.tasks.reward import ExploreWeights
from albot_env.tasks.rooms import RoomLog
from albot_env.tasks.start import choose_start
from albot_maps import World, load_world

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
        A Pioneer 3-DX with a laser and a noisy odometer sets out with an empty map. It
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
        from a pose.

    Episode end:
        Never by itself; truncated after `max_episode_steps` (6000, ten minutes), which
        `gymnasium.make` takes.

    Info:
        The truth, for evaluation: `pose` and `belief` (m, rad; the belief in the map's
        frame, which lies at the true start), `position_error` (m), `room` (empty between
        rooms), `rooms_entered`, `coverage` (share of the reachable ground), `collided`,
        `path_length` (m), `time` (s), `updates`, `surfaces`, `reward_terms`.

    Args:
        world: A world spec, or a world.
        mapper: Name of the mapper inside.
        odometer: Name of the odometer's preset: `ideal`, `pioneer` or `poor`.
        observation: `flat` or `dict`.
        render_mode: `human`, `rgb_array` or None.
        config: What actions ask for, how observations are scaled, what is rewarded.

    Raises:
        InputError: There is no such world, mapper, odometer, observation or render mode;
            or `human` without a display.
    """

    metadata = METADATA

    def __init__(
        self,
        world: str | World = "office-ring",
        *,
        mapper: str = "albot1",
        odometer: str = "pioneer",
        observation: str = "flat",
        render_mode: str | None = None,
        config: ExploreConfig = ExploreConfig(),
    ) -> None:
        if observation not in ("flat", "dict"):
            raise InputError(ENVIRONMENT, "flat or dict", str(observation), place="observation")
        self.render_mode = render_mode
        self._viewer = _open_viewer(render_mode)
        self._world = load_world(world) if isinstance(world, str) else world
        self._journey = Journey(self._world, make_mapper(mapper), odometer)
        self._config = config
        self._flat = observation == "flat"
        scaling = config.observations
        self.action_space = config.actions.space
        self.observation_space = scaling.flat_space if self._flat else scaling.dict_space

        self._covered = world_coverage(self._world, scaling.coverage)
        self._believed = map_coverage(self._world, scaling.coverage)
        self._reachable = reachable_area(self._world)
        self._rooms = RoomLog(self._world.rooms)
        self._surfaces: Segments = np.empty((0, 4))
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
        start = choose_start(self._world, self.np_random, options or {}, ENVIRONMENT)
        for tally in (self._covered, self._believed, self._rooms):
            tally.clear()
        reading = self._journey.begin(self.np_random, start)
        header = self._header(reading, seed)
        moment = self._look(reading, None)
        self._trace = Trace(header, moment)
        self.recorder.begin(header)
        self.recorder.add(moment)
        self._show()
        return self._observe(reading), self._info(moment)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s.

        Raises:
            InputError: The action is not two numbers in [-1, 1].
        """
        if self._trace is None:
            raise gymnasium.error.ResetNeeded(f"{ENVIRONMENT}: reset before the first step")
        speed, turn_rate = self._config.actions.command(action, ENVIRONMENT)
        reading = self._journey.drive(speed, turn_rate)
        moment = self._look(reading, np.array(action, np.float64))
        self._trace.add(moment)
        self.recorder.add(moment)
        self._show()
        return self._observe(reading), moment.reward, False, False, self._info(moment)

    @property
    def frame(self) -> Frame:
        """The present moment to be drawn. It holds the truth: for people, not for agents."""
        if self._trace is None:
            raise gymnasium.error.ResetNeeded(f"{ENVIRONMENT}: reset before the first frame")
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

    def _look(self, reading: Reading, action: np.ndarray | None) -> Moment:
        """See how things stand after a reading, and what the step was worth."""
        journey, mapper = self._journey, self._journey.mapper
        pose, belief = journey.simulator.pose, mapper.pose.copy()
        self._believed.add(belief, reading.laser)
        new_ground = self._covered.add(pose, reading.laser)
        room, new_room = self._rooms.enter(pose)
        collided = journey.simulator.collided
        terms = self._config.weights.terms(
            new_ground=new_ground, new_room=new_room, collided=collided, elapsed=journey.elapsed
        )
        if action is None:  # After a reset nothing has been earned yet.
            terms = dict.fromkeys(terms, 0.0)
        changed = journey.updated or action is None
        if changed:
            self._surfaces = mapper.surfaces.copy()
        return Moment(
            action=action,
            reward=math.fsum(terms.values()),
            terms=terms,
            reading=reading,
            pose=pose,
            collided=collided,
            room=room,
            path_length=journey.path_length,
            belief=belief,
            home=mapper.home.copy(),
            updates=mapper.updates,
            surfaces=self._surfaces if changed else None,
        )

    def _observe(self, reading: Reading) -> Observation:
        scaling = self._config.observations
        parts = scaling.observe(reading, self._journey.mapper, self._believed)
        return scaling.flatten(parts) if self._flat else parts

    def _info(self, moment: Moment) -> dict[str, Any]:
        start = self._journey.simulator.start
        return {
            "reward_terms": dict(moment.terms),
            "pose": moment.pose.copy(),
            "belief": moment.belief.copy(),
            "position_error": position_error(start, moment.pose, moment.belief),
            "room": moment.room,
            "rooms_entered": self._rooms.entered,
            "coverage": min(1.0, self._covered.area / self._reachable),
            "collided": moment.collided,
            "path_length": moment.path_length,
            "time": moment.reading.stamp,
            "updates": moment.updates,
            "surfaces": len(self._surfaces),
        }

    def _header(self, reading: Reading, seed: int | None) -> EpisodeHeader:
        return EpisodeHeader(
            environment=ENVIRONMENT,
            world=self._world.name,
            walls=self._world.walls,
            start=self._journey.simulator.start,
            mapper=self._journey.mapper.name,
            odometer=self._journey.odometer,
            seed=seed,
            laser=reading.laser.geometry,
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
