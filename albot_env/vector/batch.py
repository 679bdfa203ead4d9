"""Many `Albot/Explore-v0` stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool, Float32, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_env.sim import choose_sensors
from albot_env.tasks.expedition import Expedition
from albot_env.tasks.explore import ENVIRONMENT, METADATA, ExploreConfig
from albot_env.tasks.start import choose_start, choose_world
from albot_maps import World, WorldSet, load_worlds

Worlds = str | World | WorldSet
Observations = Float32[np.ndarray, "environments length"] | dict[str, Float32[np.ndarray, "..."]]
Steps = tuple[
    Observations,
    Float64[np.ndarray, "environments"],
    Bool[np.ndarray, "environments"],
    Bool[np.ndarray, "environments"],
    dict[str, Any],
]


class ExploreVectorEnv(VectorEnv[Any, Any, np.ndarray]):
    """Robots that explore, each as in an `ExploreEnv` of its own.

    What environment i gives, from the reset with its seed on, is to the last bit what
    `gymnasium.make` with the same settings gives. Spaces, rewards, and infos are those of
    `ExploreEnv`, batched as gymnasium batches them. Robots in one and the same world share
    physics, index of walls and maps of the ground.

    Args:
        num_envs: How many environments.
        world: A world spec, a world or worlds for all, of which each reset draws one; or
            such for each.
        mapper: Name of the mapper inside each, or `none`.
        odometer: Name of the odometer's preset.
        laser: Name of the laser's preset.
        sonar: Name of the sonars' preset, or `none`.
        scenes: Name of the camera's preset, or `none`.
        observation: `flat` or `dict`.
        movables: Whether doors, boxes and people move in worlds that have any.
        config: What actions ask for, how observations are scaled, what is rewarded.
        max_episode_steps: Steps after which an episode is truncated; None for never.
        autoreset_mode: `NextStep`: the step after an episode's last one resets, whatever (valid)
            action it is given. `SameStep`: the last step itself resets; the info then holds
            `final_obs` and `final_info`. `Disabled`: who steps must call
            `reset(options={"reset_mask": finished})` before.
        threads: Threads that share the work; 0 for as many as there are processors. They
            change nothing but the speed.

    Raises:
        InputError: As for `ExploreEnv`; or there are not as many worlds as environments.
    """

    metadata = METADATA

    def __init__(
        self,
        num_envs: int,
        world: Worlds | Sequence[Worlds] = "office-ring",
        *,
        mapper: str = "albot1",
        odometer: str = "pioneer",
        laser: str = "lms-200",
        sonar: str = "pioneer",
        scenes: str = "none",
        observation: str = "flat",
        movables: bool = True,
        config: ExploreConfig | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int = 0,
    ) -> None:
        if num_envs < 1:
            raise InputError(ENVIRONMENT, "at least 1", str(num_envs), place="num_envs")
        if max_episode_steps is not None and max_episode_steps < 1:
            found = str(max_episode_steps)
            raise InputError(ENVIRONMENT, "at least 1", found, place="max_episode_steps")
        if observation not in ("flat", "dict"):
            raise InputError(ENVIRONMENT, "flat or dict", str(observation), place="observation")
        self.num_envs = num_envs
        self._mode = _mode(autoreset_mode)
        self.metadata = {"render_modes": [], "autoreset_mode": self._mode}
        self._worlds = _worlds(world, num_envs)
        self._config = config = config or ExploreConfig()
        self._flat = observation == "flat"
        self._limit = max_episode_steps
        sensors = choose_sensors(
            laser=laser, odometer=odometer, sonar=sonar, scenes=scenes, source=ENVIRONMENT
        )
        self._robots = Expedition(
            num_envs,
            mapper,
            sensors,
            config.observations,
            config.weights,
            threads,
            movables=movables,
        )
        self._scaling = scaling = self._robots.observing
        self.single_action_space = config.actions.space
        self.single_observation_space = scaling.flat_space if self._flat else scaling.dict_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._over: Bool[np.ndarray, "environments"] = np.zeros(num_envs, np.bool_)
        self._begun: Bool[np.ndarray, "environments"] = np.zeros(num_envs, np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Let all robots set out anew, or with the option `reset_mask` those it says.

        Args:
            seed: One for environment 0, then counting up; or one for each.
            options: `reset_mask`, (environments,) of bool; the others as for `ExploreEnv`.

        Raises:
            InputError: An option is unknown, or a mask, a start or the seeds are none.
        """
        settings = dict(options or {})
        mask = _mask(settings.pop("reset_mask", None), self.num_envs)
        rows = np.flatnonzero(mask)
        for row, its_seed in zip(rows.tolist(), _seeds(seed, self.num_envs, rows), strict=True):
            if its_seed is not None or self._generators[row] is None:
                self._generators[row], _ = seeding.np_random(its_seed)
        self._robots.turn_page()
        self._begin(rows, settings)
        self._robots.look(None if mask.all() else rows)
        self._begun[rows], self._over[rows] = True, False
        return self._observe(), self._infos(mask)

    def step(self, actions: Any) -> Steps:
        """Drive for 0.1 s.

        Raises:
            InputError: An action is not two numbers in [-1, 1].
            ResetNeeded: An environment has not been reset, or is over in `Disabled` mode.
        """
        resetting = self._check_begun()
        commands = self._config.actions.commands(actions, self.num_envs, ENVIRONMENT)
        robots = self._robots
        robots.drive(commands)
        self._begin(np.flatnonzero(resetting), {})
        robots.look()
        self._begun[:] = True
        rewards = robots.rewards.copy()
        truncated = np.zeros(self.num_envs, np.bool_)
        if self._limit is not None:
            truncated = robots.steps >= self._limit
        self._over = truncated.copy()
        if self._mode is AutoresetMode.SAME_STEP and truncated.any():
            infos = self._start_over(truncated)
        else:
            infos = self._infos(np.ones(self.num_envs, np.bool_))
        terminated = np.zeros(self.num_envs, np.bool_)
        return self._observe(), rewards, terminated, truncated, infos

    def close_extras(self, **_: Any) -> None:
        """Let the threads go; called by `close`."""
        self._robots.close()

    def _check_begun(self) -> Bool[np.ndarray, "environments"]:
        """Which environments this step resets."""
        if not self._begun.all():
            raise gymnasium.error.ResetNeeded(f"{ENVIRONMENT}: reset before the first step")
        if self._mode is AutoresetMode.DISABLED and self._over.any():
            over = int(np.argmax(self._over))
            raise gymnasium.error.ResetNeeded(
                f"{ENVIRONMENT}: environment {over} is over, reset it before the next step"
            )
        return self._over & (self._mode is AutoresetMode.NEXT_STEP)

    def _begin(self, rows: Int64[np.ndarray, "some"], options: dict[str, Any]) -> None:
        """Let some set out anew: none of them, and none can go on, where one cannot."""
        self._begun[rows] = False
        chosen = [self._choose(row, options) for row in rows.tolist()]
        for row, (world, start, generator) in zip(rows.tolist(), chosen, strict=True):
            self._robots.begin(row, world, start, generator)

    def _choose(self, row: int, options: dict[str, Any]) -> tuple[World, Pose, np.random.Generator]:
        """Draw one's world and start."""
        generator = self._generators[row]
        assert generator is not None
        name = f"{ENVIRONMENT}, environment {row}"
        try:
            world = choose_world(self._worlds[row], generator, options, name)
            start = choose_start(world, generator, options, name)
            self._robots.check_start(world, start)
        except InputError as error:
            raise _told(error, name) from None
        return world, start, generator

    def _start_over(self, over: Bool[np.ndarray, "environments"]) -> dict[str, Any]:
        """Reset the environments that are over; the infos hold what they ended with."""
        final_obs = np.full(self.num_envs, None, object)
        for row in np.flatnonzero(over).tolist():
            final_obs[row] = self._observation(row)
        final = self._infos(over)
        rows = np.flatnonzero(over)
        self._begin(rows, {})
        self._robots.look(rows)
        self._begun[:] = True
        self._over[:] = False
        infos = self._infos(np.ones(self.num_envs, np.bool_))
        infos |= {"final_obs": final_obs, "_final_obs": over.copy()}
        return infos | {"final_info": final, "_final_info": over.copy()}

    def _observation(self, row: int) -> Any:
        """One environment's observation."""
        flat = self._robots.observations[row].copy()
        return flat if self._flat else self._scaling.split(flat)

    def _observe(self) -> Observations:
        rows = self._robots.observations
        return rows if self._flat else self._scaling.split_rows(rows)

    def _infos(self, mask: Bool[np.ndarray, "environments"]) -> dict[str, Any]:
        """The infos as gymnasium batches them: zero and `_key` False where there is none."""
        robots = self._robots
        names = {"world": robots.world_names.copy(), "room": robots.rooms}
        values = {
            "pose": robots.poses,
            "belief": robots.beliefs,
            "position_error": robots.position_errors,
            "rooms_entered": robots.rooms_entered,
            "coverage": robots.coverages,
            "collided": robots.collided,
            "path_length": robots.path_lengths,
            "time": robots.times,
            "updates": robots.updates,
            "surfaces": robots.surface_counts,
        }
        infos = {"reward_terms": _masked(robots.terms, mask), "_reward_terms": mask.copy()}
        infos |= _masked(values, mask)
        for key, value in names.items():
            value[~mask] = None
            infos[key], infos[f"_{key}"] = value, mask.copy()
        return infos


def _masked(
    values: dict[str, np.ndarray], mask: Bool[np.ndarray, "environments"]
) -> dict[str, Any]:
    """Copies of the values where the mask says so, zeros elsewhere; and the mask beside each."""
    infos: dict[str, Any] = {}
    everything = bool(mask.all())
    for key, value in values.items():
        copy = value.copy()
        if not everything:
            copy[~mask] = 0
        infos[key], infos[f"_{key}"] = copy, mask.copy()
    return infos


def _mode(mode: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(m.value for m in AutoresetMode)
        raise InputError(
            ENVIRONMENT, f"one of {names}", str(mode), place="autoreset_mode"
        ) from None


def _worlds(world: Worlds | Sequence[Worlds], count: int) -> list[WorldSet]:
    """The worlds of each environment; those of one spec are the same objects."""
    specs = [world] * count if isinstance(world, str | World | WorldSet) else list(world)
    if len(specs) != count:
        raise InputError(ENVIRONMENT, f"{count} worlds", str(len(specs)), place="world")
    loaded: dict[Any, WorldSet] = {}
    for row, spec in enumerate(specs):
        try:
            loaded[spec] = loaded.get(spec) or load_worlds(spec)
        except InputError as error:
            raise _told(error, f"{ENVIRONMENT}, world of environment {row}") from None
    return [loaded[spec] for spec in specs]


def _told(error: InputError, environment: str) -> InputError:
    """The same error, which says in which environment."""
    if error.source == environment:
        return error
    place = f"{error.source}, {error.place}" if error.place else error.source
    return InputError(environment, error.expected, error.found, place=place)


def _mask(mask: Any, count: int) -> Bool[np.ndarray, "environments"]:
    if mask is None:
        return np.ones(count, np.bool_)
    expected = f"an array of {count} bool, one of them true"
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,):
        raise InputError(ENVIRONMENT, expected, repr(mask), place="options.reset_mask")
    if not mask.any():
        raise InputError(ENVIRONMENT, expected, "none true", place="options.reset_mask")
    return mask


def _seeds(seed: Any, count: int, rows: Int64[np.ndarray, "some"]) -> list[int | None]:
    """The seeds of some environments out of `count`."""
    if seed is None:
        seeds: list[int | None] = [None] * count
    elif isinstance(seed, int | np.integer):
        seeds = [int(seed) + k for k in range(count)]
    else:
        seeds = list(np.atleast_1d(np.asarray(seed, object)))
    if len(seeds) != count:
        raise InputError(ENVIRONMENT, f"{count} seeds", str(len(seeds)), place="seed")
    for row, its_seed in enumerate(seeds):
        whole = isinstance(its_seed, int | np.integer) and not isinstance(its_seed, bool)
        if its_seed is not None and not (whole and its_seed >= 0):
            place = f"seed of environment {row}"
            raise InputError(ENVIRONMENT, "a whole number from 0", repr(its_seed), place=place)
    seeds = [None if its_seed is None else int(its_seed) for its_seed in seeds]
    return [seeds[row] for row in rows.tolist()]
