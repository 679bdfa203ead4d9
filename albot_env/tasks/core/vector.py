"""Vectorised environments: the common part of all tasks."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, Generic, Unpack

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool, Float64, Int64, UInt8

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_core.maps.layers import MapSnapshot
from albot_core.ranges import COUNT, FROM_ONE
from albot_core.sensing.reading import Readings
from albot_env.rendering.frame import Frame
from albot_env.tasks.core.batch_arguments import (
    choose_mask,
    choose_mode,
    choose_seeds,
    choose_worlds,
    named,
)
from albot_env.tasks.core.batch_followers import BatchFollowers, choose_drawn
from albot_env.tasks.core.batch_member import BatchMember
from albot_env.tasks.core.copying import CopiedByState
from albot_env.tasks.core.episode_state import (
    EpisodeState,
    check_state,
    generator_of,
    generator_state,
)
from albot_env.tasks.core.interface import (
    CLOSED,
    METADATA,
    Observation,
    Robots,
    TaskInterface,
)
from albot_env.tasks.core.journeys import Journeys, JourneySpec
from albot_env.tasks.core.settings import (
    DEFAULT_WORLD,
    Settings,
    Worlds,
    check_settings,
    choose_start,
    choose_world,
    settings_of,
)
from albot_env.tasks.core.spec import ConfiguredSpec
from albot_maps import World

StepResults = tuple[
    Observation,
    Float64[np.ndarray, "environments"],
    Bool[np.ndarray, "environments"],
    Bool[np.ndarray, "environments"],
    dict[str, Any],
]
_NOBODY: Int64[np.ndarray, "none"] = np.zeros(0, np.int64)


class VectorEnv(CopiedByState, gymnasium.vector.VectorEnv[Any, Any, np.ndarray], Generic[Robots]):
    """Robots that are stepped together, each as in its own `SingleEnv`. Subclasses name the task.

    From a reset with a seed on, environment i returns bit for bit what a single environment
    made by `gymnasium.make` with the same settings returns. Spaces, rewards and infos are those
    of the single form, batched as gymnasium batches them. Robots in the same world share its
    physics spaces, wall index and rooms. A batch can be copied and pickled: see `get_state`.

    Args:
        num_envs: Number of environments.
        world: A world spec, a world or a set of worlds for all environments, from which each
            reset draws one; or a sequence with one of these, or a list of specs that is a set,
            per environment.
        max_episode_steps: Steps after which an episode is truncated; None for never (a single
            environment takes gymnasium's, the registered number, for None).
        autoreset_mode: `NextStep`: the step after an episode's last step resets it, whatever
            the (valid) action. `SameStep`: the last step itself resets; the info then holds
            `final_obs` and `final_info`. `Disabled`: the caller must call
            `reset(options={"reset_mask": finished})`.
        render_mode: `rgb_array`, or None. Each step then takes longer, because all that is drawn
            is taken down for each environment that is drawn.
        drawn: Numbers of the environments that are drawn in `rgb_array` mode; None for all. The
            pictures of the others are black, and they are not slowed down.
        threads: Threads that share the work; None for one per processor. The number affects
            only the speed.
        settings: See `Settings`.

    Raises:
        InputError: As for `SingleEnv`; or the number of worlds differs from that of environments.
    """

    metadata = METADATA
    task: type[Robots]
    """The task's class."""

    def __init__(
        self,
        num_envs: int,
        world: Worlds | Sequence[Worlds | list[str]] = DEFAULT_WORLD,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        drawn: Sequence[int] | None = None,
        threads: int | None = None,
        **settings: Unpack[Settings],
    ) -> None:
        environment = self.task.environment
        if render_mode not in (None, "rgb_array"):
            expected = "rgb_array or None; a batch has no window"
            raise InputError(environment, expected, str(render_mode), place="render_mode")
        check_settings(settings, self.settings(), environment)
        for name, number in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            unlimited = name == "max_episode_steps" and number is None
            if not unlimited and number not in FROM_ONE:
                raise InputError("make_vec", FROM_ONE.expected, str(number), place=name)
        self._interface = interface = TaskInterface(
            self.task, num_envs, threads=threads, **settings
        )
        self._environment = interface.environment
        self._robots: Robots = interface.robots
        self.observation_config = interface.observation_config
        """How observations are made of readings, with the sensors chosen."""
        self.action_config = interface.robots.actions
        """What the numbers of an action stand for."""
        self.robot_config = interface.robot_config
        """Body and drive of the robots."""
        self.num_envs = num_envs
        self.autoreset_mode = choose_mode(autoreset_mode, environment)
        """When environments that are over are reset."""
        self.metadata = METADATA | {
            "render_modes": ["rgb_array"],
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode = render_mode
        radius = interface.robot_config.radius
        self._worlds = choose_worlds(world, num_envs, environment, radius)
        self._limit = max_episode_steps
        self.single_action_space = interface.action_space
        self.single_observation_space = interface.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._over: Bool[np.ndarray, "environments"] = np.zeros(num_envs, np.bool_)
        self._begun: Bool[np.ndarray, "environments"] = np.zeros(num_envs, np.bool_)
        self._world_numbers: Int64[np.ndarray, "environments"] = np.zeros(num_envs, np.int64)
        chosen = choose_drawn(drawn, num_envs, render_mode, environment)
        self._followers = BatchFollowers(interface, chosen)
        self._spec: ConfiguredSpec | None = None
        self._given = {
            "num_envs": num_envs,
            "world": world,
            "max_episode_steps": max_episode_steps,
            "autoreset_mode": autoreset_mode,
            "render_mode": render_mode,
            "drawn": drawn,
            "threads": threads,
            **copy.deepcopy(settings),
        }
        spaces = "action_space", "observation_space", "single_action_space"
        self._own = frozenset(vars(self)) - {"_spec", *spaces, "single_observation_space"}

    @classmethod
    def settings(cls) -> dict[str, Any]:
        """Return the types of the settings, by name."""
        return settings_of(cls.__init__, cls.task)

    @property
    def spec(self) -> EnvSpec | None:
        """The spec by which `gymnasium.make_vec` made it; its `to_json` takes configurations."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else ConfiguredSpec.of(spec)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin new episodes in all environments, or in those that the option `reset_mask` selects.

        Args:
            seed: Seed of environment 0, counted up for the others; or a sequence with one for each.
            options: `reset_mask`, (environments,) of bool; other options as for the single form.

        Raises:
            InputError: An option is unknown, or a mask, a start or the seeds are invalid.
            ClosedEnvironmentError: The environment has been closed.
        """
        self._check_open()
        if not isinstance(options or {}, Mapping):
            raise InputError(self._environment, "a mapping", repr(options), place="options")
        settings = dict(options or {})
        mask = choose_mask(settings.pop("reset_mask", None), self.num_envs, self._environment)
        rows = np.flatnonzero(mask)
        seeds = choose_seeds(seed, self.num_envs, rows, self._environment)
        for row, its_seed in zip(rows.tolist(), seeds, strict=True):
            if its_seed is not None or self._generators[row] is None:
                self._generators[row], _ = seeding.np_random(its_seed)
        self._robots.detach_observations()
        self._begin(rows, settings)
        self._robots.observe(None if mask.all() else rows)
        self._begun[rows], self._over[rows] = True, False
        self._followers.begin(rows, dict(zip(rows.tolist(), seeds, strict=True)), self.spec)
        return self._interface.shown_all(self._robots.observations), self._infos(
            None if mask.all() else mask
        )

    def step(self, actions: Any) -> StepResults:
        """Run one step: 0.1 s of driving, or one arrival of a tour.

        Raises:
            InputError: An action is not in the action space.
            ResetNeeded: An environment has not been reset, or is over in `Disabled` mode.
            ClosedEnvironmentError: The environment has been closed.
        """
        resetting = self._due()
        robots = self._robots
        self._interface.act_batch(actions, self.num_envs)
        self._begin(resetting, {})
        robots.observe()
        self._begun[:] = True
        self._followers.begin(resetting, {}, self.spec)
        self._followers.add(actions, resetting)
        rewards = robots.rewards.copy()
        truncated = np.zeros(self.num_envs, np.bool_)
        if self._limit is not None:
            truncated = robots.steps >= self._limit
        terminated = robots.ended.copy()
        self._over = over = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and over.any():
            infos = self._start_over(over.copy())
        else:
            infos = self._infos()
        return (
            self._interface.shown_all(self._robots.observations),
            rewards,
            terminated,
            truncated,
            infos,
        )

    @property
    def fact_names(self) -> frozenset[str]:
        """Names of what an info tells of the task."""
        return frozenset(self._robots.facts)

    @property
    def journeys(self) -> Journeys[Any] | None:
        """The journeys made before episodes begin; None if the task has none."""
        return self._robots.journeys

    def missing_journeys(self) -> list[JourneySpec]:
        """Return the journeys that resets may draw and that are not cached, if all would fit.

        Each is otherwise made when it is first drawn. To have them sooner, make them in parallel
        processes and pass them to `journeys.keep`.
        """
        journeys = self._robots.journeys
        return [] if journeys is None else journeys.missing(list(dict.fromkeys(self._worlds)))

    @property
    def readings(self) -> Readings:
        """The latest readings of all robots, as their mappers got them; a step overwrites them."""
        return self._robots.readings

    @property
    def obstacle_outlines(self) -> tuple[Segments, Int64[np.ndarray, "robots 2"]]:
        """The true outlines of all moving obstacles (world frame, m), which a step overwrites.

        The rows of the second array are each robot's first row and end row of the first.
        """
        return self._robots.obstacle_outlines

    @property
    def mapper(self) -> tuple[str, Any]:
        """Name of the robots' mapper, or `none`; and its whole config, None without one."""
        return self._interface.mapper, self._interface.mapper_config

    def snapshot(self, environment: int) -> MapSnapshot:
        """Return the map of an environment's robot.

        Raises:
            InputError: There is no such environment.
        """
        return self._robots.snapshot(self._row(environment))

    def changed_world(self, row: int) -> World | None:
        """Return a robot's world if its task has changed something in it; None otherwise."""
        world = self._robots.world(row)
        return None if world is self._robots.given_world(row) else world

    @property
    def lost(self) -> Bool[np.ndarray, "environments"]:
        """Whether each robot believes to be lost; never without a mapper that can tell."""
        return self._robots.lost

    @property
    def claim_outcomes(self) -> Int64[np.ndarray, "environments"]:
        """What a claim of each robot would be now, if it were the first of its visit to the room.

        1 if right, -1 if false, and 0 if it would not count. It is asked for whether or not the
        actions have a claim; in tasks that have no setting `claims` it is 0.
        """
        return self._robots.claim_outcomes

    @property
    def map_versions(self) -> Int64[np.ndarray, "environments"]:
        """Number of changes of each robot's map."""
        return self._robots.map_versions

    def close_extras(self, **_: Any) -> None:
        """End the recordings and stop the threads; called by `close`."""
        self._followers.close()
        self._robots.close()

    def render(self) -> tuple[UInt8[np.ndarray, "h w 3"], ...] | None:
        """Return the present moments as images, one per environment, in `rgb_array` mode.

        Raises:
            ResetNeeded: An environment has not been reset.
        """
        if self.render_mode is None:
            return None
        return tuple(self._render_one(row) for row in range(self.num_envs))  # type: ignore[misc]

    @property
    def frames(self) -> dict[int, Frame]:
        """The present moments that are drawn or recorded, by number of the environment.

        They hold the truth: for people, not for agents. `paint_mosaic` of
        `albot_env.rendering.mosaic` makes one picture of them.
        """
        return self._followers.frames

    @property
    def members(self) -> tuple[BatchMember, ...]:
        """The environments one by one: what each has as its own."""
        return tuple(BatchMember(self, row) for row in range(self.num_envs))

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what a method of each environment returns, or the value of an attribute.

        Args:
            name: The name of the method or attribute (see `BatchMember`).
            args: Arguments of the method.
            kwargs: Further arguments.

        Raises:
            AttributeError: The environments of a batch have no such attribute.
        """
        found = [getattr(member, name) for member in self.members]
        return tuple(each(*args, **kwargs) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return the same as `call`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each environment.

        Args:
            name: One of `BatchMember.SETTABLE`.
            values: One value for each environment, in a list or tuple; or one value for all.

        Raises:
            AttributeError: There is no such attribute, or it cannot be set.
            InputError: There are not as many values as environments, or one is of another kind.
        """
        if not isinstance(values, list | tuple):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            expected = f"{self.num_envs} values, one per environment"
            raise InputError(self._environment, expected, str(len(values)), place=name)
        for member, value in zip(self.members, values, strict=True):
            member.set_attribute(name, value)

    def get_state(self, environment: int) -> EpisodeState:
        """Return the state of an environment's episode (see `SingleEnv.get_state`).

        It is the same state as in the single form, which can continue it, and the other way round.

        Args:
            environment: Number of the environment.

        Raises:
            InputError: There is no such environment.
            ResetNeeded: It has not been reset.
            ClosedEnvironmentError: The batch has been closed.
        """
        self._check_open()
        row = self._row(environment)
        if not self._begun[row]:
            raise gymnasium.error.ResetNeeded(f"{self._environment}: reset environment {row} first")
        return EpisodeState(
            environment=self._environment,
            settings=self._interface.identity,
            world=self._robots.given_world(row),
            world_number=int(self._world_numbers[row]),
            generator=generator_state(self._generator(row)),
            robot=self._robots.state(row),
        )

    def set_state(
        self, environment: int, state: EpisodeState
    ) -> tuple[Observation, dict[str, Any]]:
        """Continue in an environment the episode that a state is from.

        Args:
            environment: Number of the environment.
            state: From `get_state` of this batch, or of any environment with the same settings.

        Returns:
            The observation of this environment, and the infos of the batch, masked but for it.

        Raises:
            InputError: There is no such environment; or as for `SingleEnv.set_state`.
            ClosedEnvironmentError: The batch has been closed.
        """
        self._check_open()
        row = self._row(environment)
        name = f"{self._environment}, environment {row}"
        try:
            identity, worlds = self._interface.identity, self._worlds[row]
            world = check_state(state, self._environment, identity, worlds, name)
            self._begun[row] = False
            self._robots.set_state(row, world, state.robot)
        except InputError as error:
            raise named(error, name) from None
        self._generators[row] = generator_of(state.generator)
        self._world_numbers[row] = state.world_number
        self._begun[row] = True
        is_late = self._limit is not None and self._robots.steps[row] >= self._limit
        self._over[row] = bool(self._robots.ended[row]) or is_late
        mask = np.arange(self.num_envs) == row
        self._followers.begin(np.flatnonzero(mask), {}, self.spec)
        return self._interface.shown(self._robots.observations[row].copy()), self._infos(mask)

    def _whole_state(self) -> Any:
        self._check_open()
        generators = [rng if rng is None else generator_state(rng) for rng in self._generators]
        states = [self.get_state(row) if self._begun[row] else None for row in range(self.num_envs)]
        return generators, states, self._over.copy()

    def _set_whole_state(self, state: Any) -> None:
        generators, states, over = state
        self._generators = [rng if rng is None else generator_of(rng) for rng in generators]
        for row, each in enumerate(states):
            if each is not None:
                self.set_state(row, each)
        self._over[:] = over

    def _shared(self) -> dict[str, Any]:
        return {"world": self._worlds}

    def _row(self, environment: Any) -> int:
        """Return the number of an environment."""
        if environment not in COUNT or environment >= self.num_envs:
            expected = f"an environment's number below {self.num_envs}"
            raise InputError(self._environment, expected, repr(environment), place="environment")
        return int(environment)

    def _generator(self, row: int) -> np.random.Generator:
        generator = self._generators[row]
        if generator is None:
            raise gymnasium.error.ResetNeeded(f"{self._environment}: reset environment {row} first")
        return generator

    def _render_one(self, row: int) -> UInt8[np.ndarray, "h w 3"] | None:
        self._check_open()
        if self.render_mode is None:
            return None
        picture = self._followers.picture(row)
        if picture is None:
            raise gymnasium.error.ResetNeeded(f"{self._environment}: reset environment {row} first")
        return picture

    def _check_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError(CLOSED.format(self._environment))

    def _due(self) -> Int64[np.ndarray, "some"]:
        """Return the environments that this step resets."""
        self._check_open()
        if not self._begun.all():
            raise gymnasium.error.ResetNeeded(f"{self._environment}: reset before the first step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._over.any():
            over = int(np.argmax(self._over))
            raise gymnasium.error.ResetNeeded(
                f"{self._environment}: environment {over} is over, reset it before the next step"
            )
        return (
            self._over.nonzero()[0] if self.autoreset_mode is AutoresetMode.NEXT_STEP else _NOBODY
        )

    def _begin(self, rows: Int64[np.ndarray, "some"], options: dict[str, Any]) -> None:
        """Begin episodes of some robots; if one cannot begin, none does, and none can continue."""
        self._begun[rows] = False
        chosen = [self._choose(row, options) for row in rows.tolist()]
        for row, (world, start, generator) in zip(rows.tolist(), chosen, strict=True):
            self._robots.begin(row, world, start, generator)

    def _choose(self, row: int, options: dict[str, Any]) -> tuple[World, Pose, np.random.Generator]:
        """Draw the world and start of an environment."""
        generator = self._generators[row]
        assert generator is not None
        name = f"{self._environment}, environment {row}"
        try:
            world, number = choose_world(self._worlds[row], generator, options, name)
            self._world_numbers[row] = number
            start = choose_start(world, generator, options, name)
            self._robots.check_start(world, start)
        except InputError as error:
            raise named(error, name) from None
        return world, start, generator

    def _start_over(self, over: Bool[np.ndarray, "environments"]) -> dict[str, Any]:
        """Reset the environments that are over; return their final observations and infos."""
        final_obs = np.full(self.num_envs, None, object)
        rows = np.flatnonzero(over)
        for row in rows.tolist():
            final_obs[row] = self._interface.shown(self._robots.observations[row].copy())
        final = self._infos(over)
        self._begin(rows, {})
        self._robots.observe(rows)
        self._begun[:] = True
        self._over[:] = False
        self._followers.begin(rows, {}, self.spec)
        infos = self._infos()
        infos |= {"final_obs": final_obs, "_final_obs": over.copy()}
        return infos | {"final_info": final, "_final_info": over.copy()}

    def _infos(self, mask: Bool[np.ndarray, "environments"] | None = None) -> dict[str, Any]:
        """Return the infos of all environments, or of some, as gymnasium batches them.

        Environments without a value have zero, and False in `_key`.
        """
        robots = self._robots
        hidden = None if mask is None else ~mask
        shown = np.ones(self.num_envs, np.bool_) if mask is None else mask
        infos = {
            "reward_terms": _masked(robots.terms, shown, hidden),
            "_reward_terms": shown.copy(),
        }
        names = {"world": robots.world_names, "room": robots.rooms}
        infos |= _masked(robots.facts, shown, hidden)
        infos |= _masked(names, shown, hidden)
        return infos


def _masked(
    values: dict[str, np.ndarray],
    shown: Bool[np.ndarray, "environments"],
    hidden: Bool[np.ndarray, "environments"] | None,
) -> dict[str, Any]:
    """Return copies of values where shown, zeros where hidden, and the mask beside each."""
    infos: dict[str, Any] = {}
    for key, value in values.items():
        copy = value.copy()
        if hidden is not None:
            copy[hidden] = None if copy.dtype == object else 0
        infos[key], infos[f"_{key}"] = copy, shown.copy()
    return infos
