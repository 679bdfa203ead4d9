"""Stress runs: agents in many worlds, each episode checked after every step.

`plan_episodes` says which episodes there are, and `StressRunner` runs each in a process of its own:
that the process dies is a violation too.
"""

from __future__ import annotations

import shlex
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from albot_agents.agent import begin_episode, choose_action
from albot_agents.registry import find_agent, make_agent
from albot_agents.workers import TaskRunner
from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.stress.checks import (
    Limits,
    all_keys,
    check_body,
    check_info,
    check_laser,
    check_observation,
    check_obstacles,
    check_reward,
    check_sonar,
)
from albot_env.tasks.core.observation import ObservationConfig
from albot_maps import World, load_world
from albot_maps.generators.spec import KINDS, PREFIX, seeded

ALL_KINDS = "random"
"""The spec that stands for all kinds of random worlds in turn."""


@dataclass(frozen=True, kw_only=True)
class Episode:
    """One agent in one world: the same as `albot play` with these options."""

    world: str
    """The world's spec."""
    agent: str
    """The agent's name."""
    mapper: str
    """Name of the mapper inside, or `none`."""
    seed: int
    """Seed of environment and agent."""
    steps: int
    """Its length, in control steps."""
    mapper_config: Any = None
    """The mapper's thresholds; None for its default ones."""
    mapper_config_file: Path | None = None
    """The YAML file that they were read from."""

    def command(self, steps: int) -> str:
        """The command that shows its first `steps` steps again."""
        options = {
            "world": self.world,
            "agent": self.agent,
            "mapper": self.mapper,
            "mapper-config": self.mapper_config_file,
            "seed": self.seed,
            "steps": max(1, steps),
        }
        given = {name: str(value) for name, value in options.items() if value is not None}
        words = [word for name, value in given.items() for word in (f"--{name}", value)]
        return shlex.join(("albot", "play", *words))


@dataclass(frozen=True, kw_only=True)
class Violation:
    """Something that must not be, and where it was."""

    episode: Episode
    """The episode."""
    step: int
    """The step after which it was seen; 0 for the reset."""
    what: str
    """What is wrong, in one line."""

    @property
    def command(self) -> str:
        """The command that shows it again."""
        return self.episode.command(self.step)


def plan_episodes(
    spec: str,
    agents: Sequence[str],
    *,
    count: int,
    first: int,
    mapper: str,
    steps: int,
    mapper_config: Any = None,
    mapper_config_file: Path | None = None,
) -> list[Episode]:
    """Every agent in every world.

    Args:
        spec: `random:KIND` or `random:KIND?…` for as many worlds of the kind, with seeds
            that count up from `first`; `random` for all kinds in turn; any other world
            spec for one world.
        agents: Names of the agents.
        count: How many worlds; of one world: how many seeds.
        first: The first seed; the seeds of the episodes count up from it.
        mapper: Name of the mapper inside.
        steps: Length of an episode.
        mapper_config: The mapper's thresholds; None for its default ones.
        mapper_config_file: The YAML file that they were read from.

    Raises:
        InputError: There is no such world. Of random worlds the first of each kind is
            made, to see.
    """
    worlds = _worlds(spec, count, first)
    for world in dict.fromkeys((*worlds[: len(KINDS)], worlds[-1])):
        load_world(world)
    return [
        Episode(
            world=world,
            agent=agent,
            mapper=mapper,
            seed=first + k,
            steps=steps,
            mapper_config=mapper_config,
            mapper_config_file=mapper_config_file,
        )
        for k, world in enumerate(worlds)
        for agent in agents
    ]


def _worlds(spec: str, count: int, first: int) -> list[str]:
    """The worlds' specs, one for each seed."""
    body, _, query = spec.partition("?")
    if body == ALL_KINDS:
        if query:
            expected = f"parameters after a kind, as {PREFIX}{KINDS[0]}?{query}"
            raise InputError(spec, expected, "all kinds")
        turns = range(count)
        return [f"{PREFIX}{KINDS[k % len(KINDS)]}:{first + k // len(KINDS)}" for k in turns]
    return [seeded(spec, first + k) for k in range(count)]


ENVIRONMENT = "Albot/Explore-v0"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of an episode."""

    episode: Episode
    """The episode."""
    steps: int
    """How many steps were taken: it ends where something is wrong."""
    violations: tuple[Violation, ...]
    """All that was wrong in the last of them."""


class StressRunner(TaskRunner[Episode, Outcome]):
    """Runs episodes and checks every step; that the process dies is a violation too."""

    def run(self, task: Episode, on_step: Callable[[int], None]) -> Outcome:
        """Run an episode."""
        return run_episode(task, on_step, Limits())

    def on_crash(self, task: Episode, step: int, cause: str) -> Outcome:
        """The outcome of an episode in which the process died."""
        return _violated(task, step, [cause])


def run_episode(episode: Episode, on_step: Callable[[int], None], limits: Limits) -> Outcome:
    """Run an episode to its end, or to the first step after which something is wrong.

    An exception in the environment or the agent is something wrong too.

    Args:
        episode: The episode.
        on_step: Is called with the number of each step before it is taken, 0 for the reset.
        limits: What may be.
    """
    step = 0
    on_step(step)
    try:
        for wrong in _checked_steps(episode, limits):
            if wrong:
                return _violated(episode, step, wrong)
            step += 1
            on_step(step)
    except Exception as error:  # noqa: BLE001  (whatever goes wrong in there is a finding)
        frames = traceback.extract_tb(error.__traceback__)
        place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
        said = " ".join(str(error).split())
        return _violated(episode, step, [f"{type(error).__name__}: {said}{place}"])
    return Outcome(episode=episode, steps=step - 1, violations=())


def _violated(episode: Episode, step: int, wrong: Sequence[str]) -> Outcome:
    violations = tuple(Violation(episode=episode, step=step, what=what) for what in wrong)
    return Outcome(episode=episode, steps=step, violations=violations)


def _checked_steps(episode: Episode, limits: Limits) -> Iterator[list[str]]:
    """What is wrong after the reset, and after each step."""
    asked = {"world": episode.world, "mapper": episode.mapper, "max_episode_steps": episode.steps}
    if episode.mapper_config is not None:
        asked["mapper_config"] = episode.mapper_config
    settings = find_agent(episode.agent).environment(ENVIRONMENT, asked)
    env = gymnasium.make(ENVIRONMENT, disable_env_checker=True, **settings)
    try:
        observing = env.get_wrapper_attr("observing")
        agent = make_agent(episode.agent, observing, ENVIRONMENT)
        recorder = LastMoment()
        env.set_wrapper_attr("recorder", recorder)
        world = load_world(episode.world)
        checker = StepChecker(world, recorder, env.observation_space, observing, limits)
        observation, info = begin_episode(env, agent, episode.seed)
        yield checker.after_reset(observation, info)
        over = False
        while not over:
            action = choose_action(agent, observation, info)
            observation, reward, terminated, truncated, info = env.step(action)
            over = terminated or truncated
            yield checker.after_step(observation, float(reward), info)
    finally:
        env.close()


class LastMoment:
    """A recorder that keeps the last moment only: where things are, what the sonars measured."""

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode."""

    def close(self) -> None:
        """Do nothing: there is no file."""

    def add(self, moment: Moment) -> None:
        """Keep the next moment."""
        self.last = moment


class StepChecker:
    """Checks an episode step by step.

    Args:
        world: The world that the robot is in.
        recorder: The environment's recorder.
        space: The space of its observations.
        observing: How they are made of readings.
        limits: What may be.
    """

    def __init__(
        self,
        world: World,
        recorder: LastMoment,
        space: gymnasium.Space[Any],
        observing: ObservationConfig,
        limits: Limits,
    ) -> None:
        self._walls, self._opaque = world.walls, world.opaque
        self._recorder = recorder
        self._space = space
        self._limits = limits
        self._observing = observing

    def after_reset(self, observation: Any, info: dict[str, Any]) -> list[str]:
        """Check a reset; what is wrong after it."""
        self._keys = all_keys(info)
        self._position = info["pose"][:2].copy()
        return self._check(observation, info)

    def after_step(self, observation: Any, reward: float, info: dict[str, Any]) -> list[str]:
        """Check a step; what is wrong after it."""
        return [*check_reward(reward, info["reward_terms"]), *self._check(observation, info)]

    def _check(self, observation: Any, info: dict[str, Any]) -> list[str]:
        before, self._position = self._position, info["pose"][:2].copy()
        wrong = check_observation(observation, self._space)
        wrong += check_info(info, self._keys)
        wrong += check_body(self._walls, before, self._position, self._limits)
        wrong += check_obstacles(self._recorder.last.things, self._position, self._limits)
        if wrong:
            return wrong  # A wrong observation has no ranges to check.
        return self._check_ranges(observation, info["pose"])

    def _check_ranges(self, observation: Any, pose: Pose) -> list[str]:
        """What is wrong with what laser and sonars measured."""
        moment, observing = self._recorder.last, self._observing
        wrong: list[str] = []
        if moment.reading.laser is not None:
            seen = np.concatenate((self._opaque, moment.things))
            laser, ranges = moment.reading.laser.geometry, moment.reading.laser.ranges
            if "laser" in observing.shapes and observing.laser_sectors is None:
                ranges = observing.ranges(observing.split(observation)["laser"])
            mount = compose(pose, np.array(laser.mount))
            wrong += check_laser(seen, mount, laser.bearings, ranges, self._limits)
        if moment.reading.sonar is not None:
            surfaces = np.concatenate((self._walls, moment.things))
            wrong += check_sonar(surfaces, pose, moment.reading.sonar, self._limits)
        return wrong
