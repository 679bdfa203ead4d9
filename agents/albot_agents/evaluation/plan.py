"""The plan of an evaluation: its episodes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium
from gymnasium.spaces import Space

import albot_env
from albot_core.errors import InputError
from albot_core.robot import DEFAULT_ROBOT, choose_robot
from albot_env.export.transitions import TransitionsLog, environment_spec
from albot_env.recording.command import play_lines
from albot_env.recording.episode import Recorder
from albot_maps import World, load_world
from albot_maps.generators.spec import PREFIX, seeded

assert albot_env.__doc__  # Importing it registers the environments.


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One agent in one episode."""

    task: str
    """Id of the environment."""
    agent: str
    """The agent's name."""
    world: str
    """The world's spec."""
    seed: int
    """Seed of environment and agent."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Other arguments of `gymnasium.make`."""
    keeps_transitions: bool = False
    """Whether its outcome has the transitions, for a data set."""

    def make(self) -> gymnasium.Env[Any, Any]:
        """Make its environment.

        Raises:
            InputError: There is no such world, mapper or sensor.
        """
        settings = {"world": self.loaded_world, **self.settings}
        return gymnasium.make(self.task, disable_env_checker=True, **settings)

    def make_recorded(self, recorder: Recorder) -> gymnasium.Env[Any, Any]:
        """Make its environment with a recorder.

        The recording names the world by its spec, so that the episode can be made again.

        Raises:
            InputError: As `make`.
        """
        settings = {"world": self.world, **self.settings}
        env = gymnasium.make(self.task, disable_env_checker=True, **settings)
        inside: Any = env.unwrapped
        inside.recorder, inside.agent = recorder, self.agent
        inside.spec = env.spec  # With the time limit.
        return env

    def begin_log(self, observation: Any, spaces: tuple[Space[Any], Space[Any]]) -> TransitionsLog:
        """Begin to take down its transitions.

        Args:
            observation: The observation of the reset.
            spaces: The spaces of observations and of actions.
        """
        return TransitionsLog(
            spec=environment_spec(self.task, {"world": self.world, **self.settings}),
            observation_space=spaces[0],
            action_space=spaces[1],
            seed=self.seed,
            agent=self.agent,
            observation=observation,
        )

    def command(self, steps: int | None = None) -> str:
        """Return lines for a shell that play the episode; empty if `albot play` cannot.

        Args:
            steps: Number of steps; None for all.
        """
        try:
            spec = environment_spec(self.task, {"world": self.world, **self.settings})
        except InputError:  # JSON cannot hold a setting.
            return ""
        steps = spec["max_episode_steps"] if steps is None else steps
        return play_lines(self.task, spec["kwargs"], self.agent, self.seed, steps)

    @property
    def loaded_world(self) -> World:
        """Its world; consecutive trials in one world share the same object.

        Raises:
            InputError: There is no such world, or it is not valid for the robot.
        """
        robot = choose_robot(self.settings.get("robot", DEFAULT_ROBOT), self.task)
        return _loaded(self.world, robot.radius)


@lru_cache(maxsize=4)
def _loaded(spec: str, robot_radius: float) -> World:
    return load_world(spec, robot_radius)


MOST_SEEDS = 1_000_000
"""Largest number of seeds; the plan of more would fill the memory."""


def parse_seeds(text: str, option: str = "--seeds") -> range:
    """Parse the seeds of `A..B`, both included, or of one number.

    Args:
        text: The text.
        option: The option that it was given to, for the error.

    Raises:
        InputError: The text is neither, B is below A, or there are more than `MOST_SEEDS`.
    """
    found = re.fullmatch(r"(\d{1,18})(?:\.\.(\d{1,18}))?", text.strip())
    if found is None:
        raise InputError(option, "A..B, as 1000..1019, or one seed", text or "nothing")
    first, last = int(found[1]), int(found[2] or found[1])
    if last < first:
        raise InputError(option, "a range A..B with B at least A", text)
    if last - first >= MOST_SEEDS:
        raise InputError(option, f"at most {MOST_SEEDS:,} seeds", text)
    return range(first, last + 1)


def plan_trials(
    task: str, agent: str, worlds: Sequence[str], seeds: range, settings: Mapping[str, Any]
) -> list[Trial]:
    """Plan one episode per world and seed; for `random:KIND` each seed is a world of its own.

    Args:
        task: Id of the environment.
        agent: The agent's name.
        worlds: World specs, which may be `random:KIND` or `random:KIND?…`, and patterns of
            files such as `plans/*.yaml`.
        seeds: The seeds.
        settings: Other settings of the environments.

    Raises:
        InputError: The world of the first or of the last episode cannot be loaded.
    """
    trials = [
        Trial(task=task, agent=agent, world=seeded(world, seed), seed=seed, settings=settings)
        for spec in worlds
        for world in _files(spec)
        for seed in seeds
    ]
    for trial in (*trials[:1], *trials[-1:]):
        assert trial.loaded_world
    # A world that is named twice, or by a pattern too, is run once.
    return list({(trial.world, trial.seed): trial for trial in trials}.values())


def _files(spec: str) -> list[str]:
    """Return the files that match a pattern; any other spec unchanged."""
    if spec.startswith(PREFIX) or not any(sign in spec for sign in "*?["):
        return [spec]
    path = Path(spec)
    found = sorted(str(file) for file in Path(path.anchor).glob(str(path.relative_to(path.anchor))))
    if not found:
        raise InputError("--worlds", "a pattern that matches files", spec)
    return found
