"""An environment with one robot: what all tasks have in common."""

from __future__ import annotations

import copy
from typing import Any, Generic, Unpack

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from jaxtyping import UInt8

from albot_core.errors import InputError
from albot_core.robot import DEFAULT_ROBOT, choose_robot
from albot_env.recording.episode import Recorder
from albot_env.rendering.frame import Frame
from albot_env.rendering.viewer import NullViewer, Viewer
from albot_env.tasks.core.copying import CopiedByState
from albot_env.tasks.core.episode_state import (
    EpisodeState,
    check_state,
    generator_of,
    generator_state,
)
from albot_env.tasks.core.follower import EpisodeFollower, painted
from albot_env.tasks.core.interface import (
    CLOSED,
    METADATA,
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
from albot_env.tasks.core.spec import ConfiguredSpec
from albot_maps import load_worlds


class SingleEnv(CopiedByState, gymnasium.Env[Any, Any], Generic[Robots]):
    """One robot with a task. A task's environment names its class, and is documented there.

    It can be copied and pickled: see `get_state`.

    Args:
        world: A world spec, several, a world, or worlds (see `albot_maps.load_worlds`).
        render_mode: `human`, `rgb_array` or None.
        settings: See `Settings`.

    Raises:
        InputError: There is no such setting, world, mapper, robot, sensor, observation or render
            mode; the world is not valid for the robot; or `human` where no window opens.
    """

    metadata = METADATA
    task: type[Robots]
    """The task's class."""

    def __init__(
        self,
        world: Worlds | list[str] = DEFAULT_WORLD,
        *,
        render_mode: str | None = None,
        **settings: Unpack[Settings],
    ) -> None:
        environment = self.task.environment
        check_settings(settings, self.settings(), environment)
        robot = choose_robot(settings.get("robot", DEFAULT_ROBOT), environment)
        self._worlds = load_worlds(world, robot.radius)
        self._interface = interface = TaskInterface(self.task, 1, **settings)
        self._environment = interface.environment
        self._robot: Robots = interface.robots
        self.render_mode = render_mode
        self._viewer = _open_viewer(render_mode, environment)
        self.observation_config = interface.observation_config
        """How observations are made of readings, with the sensors chosen."""
        self.action_config = interface.robots.actions
        """What the numbers of an action stand for."""
        self.robot_config = robot
        """Body and drive of the robot."""
        self.action_space = interface.action_space
        self.observation_space = interface.observation_space
        self._begun = self._closed = False
        self._world_number = 0
        self._follower = EpisodeFollower(interface, 0)
        self._spec: ConfiguredSpec | None = None
        self._given = {"world": world, "render_mode": render_mode, **copy.deepcopy(settings)}
        self._own = frozenset(vars(self)) - {"_spec", "action_space", "observation_space"}

    @classmethod
    def settings(cls) -> dict[str, Any]:
        """Return the types of the settings, by name."""
        return settings_of(cls.__init__, cls.task)

    @property
    def spec(self) -> EnvSpec | None:
        """The spec by which `gymnasium.make` made it; its `to_json` takes configurations too."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else ConfiguredSpec.of(spec)

    @property
    def recorder(self) -> Recorder:
        """Records the episodes from the next reset on."""
        return self._follower.recorder

    @recorder.setter
    def recorder(self, recorder: Recorder) -> None:
        self._follower.recorder = recorder

    @property
    def agent(self) -> str:
        """Name of the agent that acts, for recordings and pictures from the next reset on."""
        return self._follower.agent

    @agent.setter
    def agent(self, agent: str) -> None:
        self._follower.agent = agent

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
        world, self._world_number = choose_world(
            self._worlds, self.np_random, options or {}, self._environment
        )
        start = choose_start(world, self.np_random, options or {}, self._environment)
        self._robot.check_start(world, start)
        self._robot.begin(0, world, start, self.np_random)
        self._robot.detach_observations()
        self._robot.observe()
        self._begin_following(seed)
        return self._interface.shown(self._robot.observations[0]), self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s.

        Raises:
            InputError: The action has another shape, or is not finite.
            ResetNeeded: There was no reset before.
            ClosedEnvironmentError: It has been closed.
        """
        self._check_begun()
        robot = self._robot
        self._interface.act_single(action)
        robot.observe()
        self._follower.add(action)
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
    def most_steps(self) -> int | None:
        """Number of steps after which the task ends the episode at the latest; None if unknown."""
        return self._robot.most_steps(0)

    @property
    def judges_success(self) -> bool:
        """Whether the task can succeed: whether its info holds `is_success`."""
        return "is_success" in self._robot.facts

    @property
    def frame(self) -> Frame:
        """The present moment to be drawn. It holds the truth: for people, not for agents.

        Raises:
            ResetNeeded: There was no reset since the environment has a render mode or a
                recorder, without which nobody follows the robot.
        """
        frame = self._follower.frame
        if frame is None:
            wanted = "reset with a render mode or a recorder before the first frame"
            raise gymnasium.error.ResetNeeded(f"{self._environment}: {wanted}")
        return frame

    def render(self) -> UInt8[np.ndarray, "h w 3"] | None:
        """The present moment as an image in `rgb_array` mode; `human` shows every step anyway."""
        return painted(self.frame) if self.render_mode == "rgb_array" else None

    def get_state(self) -> EpisodeState:
        """Return the state of the episode, by which it can be branched, or continued elsewhere.

        Raises:
            ResetNeeded: There was no reset before.
            ClosedEnvironmentError: It has been closed.
        """
        self._check_begun()
        return EpisodeState(
            environment=self._environment,
            settings=self._interface.identity,
            world=self._robot.given_world(0),
            world_number=self._world_number,
            generator=generator_state(self.np_random),
            robot=self._robot.state(0),
        )

    def set_state(self, state: EpisodeState) -> tuple[Observation, dict[str, Any]]:
        """Continue, to the bit, the episode that a state is from; return what the robot observes.

        The robot's motion since its episode began is repeated, which takes longer the longer that
        was. A picture or recording begins anew. Wrappers know nothing of it: a `TimeLimit` counts
        on (`env.set_wrapper_attr("_elapsed_steps", state.steps)` tells it).

        Args:
            state: From `get_state` of this environment, or of one with the same settings.

        Raises:
            InputError: It is no state; or it is one of another environment, of other settings,
                of another world, or from another kind of machine.
            ClosedEnvironmentError: It has been closed.
        """
        self._check_open()
        world = check_state(state, self._environment, self._interface.identity, self._worlds)
        self._begun = False
        self._robot.set_state(0, world, state.robot)
        self.np_random = generator_of(state.generator)
        self._world_number = state.world_number
        self._begin_following(None)
        return self._interface.shown(self._robot.observations[0]), self._info()

    def close(self) -> None:
        """Close the window and the recording; nothing can be done with it any more."""
        self._closed = True
        self._viewer.close()
        self.recorder.close()
        self._robot.close()

    def _whole_state(self) -> Any:
        self._check_open()
        if self._begun:
            return self.get_state()
        return None if self._np_random is None else generator_state(self._np_random)

    def _set_whole_state(self, state: Any) -> None:
        if isinstance(state, EpisodeState):
            self.set_state(state)
        elif state is not None:
            self.np_random = generator_of(state)

    def _shared(self) -> dict[str, Any]:
        return {"world": self._worlds}

    def _check_open(self) -> None:
        if self._closed:
            raise gymnasium.error.ClosedEnvironmentError(CLOSED.format(self._environment))

    def _check_begun(self) -> None:
        self._check_open()
        if not self._begun:
            raise gymnasium.error.ResetNeeded(f"{self._environment}: reset before the first step")

    def _begin_following(self, seed: int | None) -> None:
        """Take down the episode from now on, if somebody wants to know how each step goes."""
        self._begun = False  # Until the recorder has agreed.
        if self.render_mode is None and not self._follower.records:
            self._follower.forget()
        else:
            self._follower.begin(seed, self._spec)
            self._show()
        self._begun = True

    def _info(self) -> dict[str, Any]:
        robot = self._robot
        return {
            "reward_terms": robot.terms_of(0),
            "world": robot.world(0).name,
            "room": robot.room(0),
            **{
                # One robot's row: a copy of an array, or a number of Python's own.
                name: fact.item(0) if fact.ndim == 1 else fact[0].copy()
                for name, fact in robot.facts.items()
            },
        }

    def _show(self) -> None:
        if self.render_mode == "human":
            self._viewer.show(self.frame)


def _open_viewer(render_mode: str | None, environment: str) -> Viewer:
    if render_mode == "human":
        from albot_env.rendering.window import Window

        return Window(environment)
    if render_mode not in (None, "rgb_array"):
        raise InputError(environment, "human, rgb_array or None", render_mode, place="render_mode")
    return NullViewer()
