"""Many environments stepped together: what all tasks have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool, Float32, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.ranges import Range
from albot_env.tasks.core.journeys import Journeys, Ticket
from albot_env.tasks.core.settings import Equipment, Settings, equip, wants_discrete, wants_flat
from albot_env.tasks.core.single import METADATA, Robots
from albot_env.tasks.core.start import choose_start, choose_world
from albot_env.vector.settings import (
    Worlds,
    choose_mask,
    choose_mode,
    choose_seeds,
    choose_worlds,
    told,
)
from albot_maps import World

Observations = Float32[np.ndarray, "environments length"] | dict[str, Float32[np.ndarray, "..."]]
Steps = tuple[
    Observations,
    Float64[np.ndarray, "environments"],
    Bool[np.ndarray, "environments"],
    Bool[np.ndarray, "environments"],
    dict[str, Any],
]
_NOBODY: Int64[np.ndarray, "none"] = np.zeros(0, np.int64)
_STEPS = Range("a whole number from 1", 1.0, whole=True)


class BatchSettings(Settings, total=False):
    """What every batch takes by name."""

    max_episode_steps: int | None
    """Steps after which an episode is truncated; None for never."""
    autoreset_mode: str | AutoresetMode
    """`NextStep`: the step after an episode's last one resets, whatever (valid) action it is
    given. `SameStep`: the last step itself resets; the info then holds `final_obs` and
    `final_info`. `Disabled`: who steps must call `reset(options={"reset_mask": finished})`
    before."""
    threads: int
    """Threads that share the work; 0 for as many as there are processors. They change nothing
    but the speed."""


class BatchEnv(VectorEnv[Any, Any, np.ndarray], Generic[Robots]):
    """Robots, each as in a `SingleEnv` of its own.

    What environment i gives, from the reset with its seed on, is to the last bit what
    `gymnasium.make` with the same settings gives. Spaces, rewards, and infos are those of
    the single form, batched as gymnasium batches them. Robots in one and the same world share
    physics, index of walls and maps of the ground.

    Args:
        gather: Makes the expedition of so many robots with this equipment.
        num_envs: How many environments.
        world: A world spec, a world or worlds for all, of which each reset draws one; or
            such for each.
        mapper, odometer, laser, sonar, scenes, observation, action, movables: See `Settings`.
        max_episode_steps, autoreset_mode, threads: See `BatchSettings`.

    Raises:
        InputError: As for `SingleEnv`; or there are not as many worlds as environments.
    """

    metadata = METADATA

    def __init__(
        self,
        gather: Callable[[int, Equipment], Robots],
        num_envs: int,
        world: Worlds | Sequence[Worlds],
        *,
        mapper: str = "albot1",
        odometer: str = "pioneer",
        laser: str = "lms-200",
        sonar: str = "pioneer",
        scenes: str = "none",
        observation: str = "flat",
        action: str = "continuous",
        movables: bool = True,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int = 0,
    ) -> None:
        if num_envs < 1:
            raise InputError("make_vec", "at least 1", str(num_envs), place="num_envs")
        if max_episode_steps is not None and max_episode_steps not in _STEPS:
            found = str(max_episode_steps)
            raise InputError("make_vec", _STEPS.expected, found, place="max_episode_steps")
        equipment = equip(
            mapper=mapper,
            odometer=odometer,
            laser=laser,
            sonar=sonar,
            scenes=scenes,
            movables=movables,
            threads=threads,
        )
        self._robots = gather(num_envs, equipment)
        self._task = task = self._robots.task
        self.num_envs = num_envs
        self._mode = choose_mode(autoreset_mode, task)
        self.metadata = {"render_modes": [], "autoreset_mode": self._mode}
        self._worlds = choose_worlds(world, num_envs, task)
        self._flat = wants_flat(observation, task)
        self._limit = max_episode_steps
        self._scaling = scaling = self._robots.observing
        actions = self._robots.actions
        self._discrete = wants_discrete(action, task)
        self.single_action_space = actions.choice_space if self._discrete else actions.space
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
        """Begin new episodes of all, or with the option `reset_mask` those it says.

        Args:
            seed: One for environment 0, then counting up; or one for each.
            options: `reset_mask`, (environments,) of bool; the others as for the single form.

        Raises:
            InputError: An option is unknown, or a mask, a start or the seeds are none.
        """
        if not isinstance(options or {}, Mapping):
            raise InputError(self._task, "a mapping", repr(options), place="options")
        settings = dict(options or {})
        mask = choose_mask(settings.pop("reset_mask", None), self.num_envs, self._task)
        rows = np.flatnonzero(mask)
        seeds = choose_seeds(seed, self.num_envs, rows, self._task)
        for row, its_seed in zip(rows.tolist(), seeds, strict=True):
            if its_seed is not None or self._generators[row] is None:
                self._generators[row], _ = seeding.np_random(its_seed)
        self._robots.turn_page()
        self._begin(rows, settings)
        self._robots.look(None if mask.all() else rows)
        self._begun[rows], self._over[rows] = True, False
        return self._observe(), self._infos(None if mask.all() else mask)

    def step(self, actions: Any) -> Steps:
        """Drive for 0.1 s.

        Raises:
            InputError: An action is not in the action space.
            ResetNeeded: An environment has not been reset, or is over in `Disabled` mode.
        """
        resetting = self._due()
        robots = self._robots
        if self._discrete:
            actions = robots.actions.chosen(actions, self.num_envs, self._task)
        robots.act(robots.actions.batch(actions, self.num_envs, self._task))
        self._begin(resetting, {})
        robots.look()
        self._begun[:] = True
        rewards = robots.rewards.copy()
        truncated = np.zeros(self.num_envs, np.bool_)
        if self._limit is not None:
            truncated = robots.steps >= self._limit
        terminated = robots.ended.copy()
        self._over = over = terminated | truncated
        if self._mode is AutoresetMode.SAME_STEP and over.any():
            infos = self._start_over(over.copy())
        else:
            infos = self._infos()
        return self._observe(), rewards, terminated, truncated, infos

    @property
    def journeys(self) -> Journeys[Any] | None:
        """What robots have behind them when an episode begins; None where they set out anew."""
        return self._robots.journeys

    def missing_journeys(self) -> list[Ticket]:
        """The journeys that resets may draw and that are not kept yet, if all could be kept.

        Each is made when it is first drawn; who wants them sooner makes them elsewhere, in
        processes side by side, and gives them to `journeys.keep`.
        """
        journeys = self._robots.journeys
        return [] if journeys is None else journeys.missing(list(dict.fromkeys(self._worlds)))

    def close_extras(self, **_: Any) -> None:
        """Let the threads go; called by `close`."""
        self._robots.close()

    def _due(self) -> Int64[np.ndarray, "some"]:
        """The environments that this step resets."""
        if not self._begun.all():
            raise gymnasium.error.ResetNeeded(f"{self._task}: reset before the first step")
        if self._mode is AutoresetMode.DISABLED and self._over.any():
            over = int(np.argmax(self._over))
            raise gymnasium.error.ResetNeeded(
                f"{self._task}: environment {over} is over, reset it before the next step"
            )
        return self._over.nonzero()[0] if self._mode is AutoresetMode.NEXT_STEP else _NOBODY

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
        name = f"{self._task}, environment {row}"
        try:
            world = choose_world(self._worlds[row], generator, options, name)
            start = choose_start(world, generator, options, name)
            self._robots.check_start(world, start)
        except InputError as error:
            raise told(error, name) from None
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
        infos = self._infos()
        infos |= {"final_obs": final_obs, "_final_obs": over.copy()}
        return infos | {"final_info": final, "_final_info": over.copy()}

    def _observation(self, row: int) -> Any:
        """One environment's observation."""
        flat = self._robots.observations[row].copy()
        return flat if self._flat else self._scaling.split(flat)

    def _observe(self) -> Observations:
        rows = self._robots.observations
        return rows if self._flat else self._scaling.split_rows(rows)

    def _infos(self, mask: Bool[np.ndarray, "environments"] | None = None) -> dict[str, Any]:
        """The infos of all, or of some, as gymnasium batches them.

        Zero and `_key` False where there is none.
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
    """Copies of the values where they are shown, nothing where hidden; and the mask beside each."""
    infos: dict[str, Any] = {}
    for key, value in values.items():
        copy = value.copy()
        if hidden is not None:
            copy[hidden] = None if copy.dtype == object else 0
        infos[key], infos[f"_{key}"] = copy, shown.copy()
    return infos
