"""Stress runs: agents in many worlds, with checks after every step.

`plan_episodes` lists the episodes, and `run_episode` runs one. A process that dies in an episode
counts as a violation too (`crashed_episode`).
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float64

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.engine.engine import Crash, name_error
from albot_agents.registry import find_agent, make_agent
from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose
from albot_core.robot import DEFAULT_ROBOT, choose_robot
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.stress.checks import (
    Limits,
    all_keys,
    check_body,
    check_boxes,
    check_info,
    check_laser,
    check_observation,
    check_obstacles,
    check_reward,
    check_sonar,
)
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.sensors import LASER
from albot_maps import World, load_world
from albot_maps.generators.spec import KINDS, PREFIX, seeded

ALL_KINDS = "random"
"""The spec that means all kinds of random worlds in turn."""
ENVIRONMENT = "Albot/Explore-v0"
"""Id of the environment."""
_LIMITS = Limits()


@dataclass(frozen=True, kw_only=True)
class Episode:
    """One agent in one world; the same episode as `albot play` with these options."""

    world: str
    """The world's spec."""
    agent: str
    """The agent's name."""
    mapper: str
    """Name of the mapper in the environment, or `none`."""
    seed: int
    """Seed of environment and agent."""
    steps: int
    """Length of the episode (control steps)."""
    mapper_config: Any = None
    """The mapper's parameters; None for the defaults."""
    mapper_config_file: Path | None = None
    """The YAML file with these parameters."""
    robot: str | None = None
    """Name of the robot; None for the agent's own."""

    def make(self) -> gymnasium.Env[Any, Any]:
        """Make its environment.

        Raises:
            InputError: There is no such world, mapper or agent, or the robot lacks a sensor that
                the mapper needs.
        """
        asked = {"world": self.world, "mapper": self.mapper, "max_episode_steps": self.steps}
        more = {"mapper_config": self.mapper_config, "robot": self.robot}
        asked |= {name: value for name, value in more.items() if value is not None}
        settings = find_agent(self.agent).environment(ENVIRONMENT, asked)
        return gymnasium.make(ENVIRONMENT, disable_env_checker=True, **settings)

    def command(self, steps: int) -> str:
        """Return the command that replays the first `steps` steps."""
        options = {
            "world": self.world,
            "agent": self.agent,
            "mapper": self.mapper,
            "mapper-config": self.mapper_config_file,
            "robot": self.robot,
            "seed": self.seed,
            "steps": max(1, steps),
        }
        given = {name: str(value) for name, value in options.items() if value is not None}
        words = [word for name, value in given.items() for word in (f"--{name}", value)]
        return shlex.join(("albot", "play", *words))


@dataclass(frozen=True, kw_only=True)
class Violation:
    """A failed check, and where it failed."""

    episode: Episode
    """The episode."""
    step: int
    """Number of the step after which the check failed; 0 for the reset."""
    what: str
    """What is wrong, in one line."""

    @property
    def command(self) -> str:
        """The command that reproduces it."""
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
    robot: str | None = None,
) -> list[Episode]:
    """Plan an episode for every agent in every world.

    Args:
        spec: `random:KIND` or `random:KIND?…` for `count` worlds of the kind, with seeds that
            count up from `first`; `random` for all kinds in turn; any other world spec for
            one world.
        agents: Names of the agents.
        count: Number of worlds, or of seeds if there is one world.
        first: The first seed; the episodes' seeds count up from it.
        mapper: Name of the mapper in the environment.
        steps: Length of an episode (control steps).
        mapper_config: The mapper's parameters; None for the defaults.
        mapper_config_file: The YAML file with these parameters.
        robot: Name of the robot; None for each agent's own.

    Raises:
        InputError: A world cannot be loaded, or the first environment of an agent not be made. Of
            random worlds, the first of each kind and the last are generated to check this.
    """
    worlds = _worlds(spec, count, first)
    for world in dict.fromkeys((*worlds[: len(KINDS)], worlds[-1])):
        load_world(world, choose_robot(robot or DEFAULT_ROBOT, "robot").radius)
    episodes = [
        Episode(
            world=world,
            agent=agent,
            mapper=mapper,
            seed=first + k,
            steps=steps,
            mapper_config=mapper_config,
            mapper_config_file=mapper_config_file,
            robot=robot,
        )
        for k, world in enumerate(worlds)
        for agent in agents
    ]
    for episode in episodes[: len(agents)]:
        episode.make().close()
    return episodes


def _worlds(spec: str, count: int, first: int) -> list[str]:
    """Return the worlds' specs, one per seed."""
    body, _, query = spec.partition("?")
    if body == ALL_KINDS:
        if query:
            expected = f"parameters after a kind, as {PREFIX}{KINDS[0]}?{query}"
            raise InputError(spec, expected, "all kinds")
        turns = range(count)
        return [f"{PREFIX}{KINDS[k % len(KINDS)]}:{first + k // len(KINDS)}" for k in turns]
    return [seeded(spec, first + k) for k in range(count)]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of an episode."""

    episode: Episode
    """The episode."""
    steps: int
    """Number of steps taken; the episode ends at the first violation."""
    violations: tuple[Violation, ...]
    """All violations of the last step."""


def run_episode(
    episode: Episode, on_step: Callable[[int], None], limits: Limits = _LIMITS
) -> Outcome:
    """Run an episode to its end, or to the first step with a violation.

    An exception in the environment or the agent is a violation too.

    Args:
        episode: The episode.
        on_step: Called before each step with its number; 0 for the reset.
        limits: The tolerances of the checks.
    """
    step = 0
    on_step(step)
    try:
        for wrong in _checked_steps(episode, limits):
            if wrong:
                return _violated(episode, step, wrong)
            step += 1
            on_step(step)
    except Exception as error:  # noqa: BLE001  (any exception is a finding)
        return _violated(episode, step, [name_error(error)])
    return Outcome(episode=episode, steps=step - 1, violations=())


def crashed_episode(episode: Episode, crash: Crash) -> Outcome:
    """Return the outcome of an episode in which the process died each time that it was run.

    If the step is not known, the command that reproduces it has all steps.
    """
    step = episode.steps if crash.step is None else crash.step
    return _violated(episode, step, [crash.cause])


def _violated(episode: Episode, step: int, wrong: Sequence[str]) -> Outcome:
    violations = tuple(Violation(episode=episode, step=step, what=what) for what in wrong)
    return Outcome(episode=episode, steps=step, violations=violations)


def _checked_steps(episode: Episode, limits: Limits) -> Iterator[list[str]]:
    """Yield what is wrong after the reset, then after each step."""
    env = episode.make()
    try:
        observation_config = env.get_wrapper_attr("observation_config")
        agent = make_agent(episode.agent, EnvironmentConfigs.of(env))
        recorder = LastMoment()
        env.set_wrapper_attr("recorder", recorder)
        radius = env.get_wrapper_attr("robot_config").radius
        world, limits = load_world(episode.world, radius), replace(limits, radius=radius)
        checker = StepChecker(world, recorder, env.observation_space, observation_config, limits)
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
    """A recorder that keeps only the last moment: obstacles and sensor readings."""

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode."""

    def close(self) -> None:
        """Do nothing; there is no file."""

    def add(self, moment: Moment) -> None:
        """Keep the next moment."""
        self.last = moment


class StepChecker:
    """Checks an episode step by step.

    Args:
        world: The robot's world.
        recorder: The environment's recorder.
        space: The environment's observation space.
        observation_config: The environment's observation config.
        limits: The tolerances of the checks.
    """

    def __init__(
        self,
        world: World,
        recorder: LastMoment,
        space: gymnasium.Space[Any],
        observation_config: ObservationConfig,
        limits: Limits,
    ) -> None:
        self._walls, self._opaque = world.walls, world.opaque
        self._movables = world.movables
        self._recorder = recorder
        self._space = space
        self._limits = limits
        self._observation_config = observation_config

    def after_reset(self, observation: Any, info: dict[str, Any]) -> list[str]:
        """Check a reset; return what is wrong."""
        self._keys = all_keys(info)
        self._position = info["pose"][:2].copy()
        self._boxes = self._box_corners()
        return self._check(observation, info)

    def after_step(self, observation: Any, reward: float, info: dict[str, Any]) -> list[str]:
        """Check a step; return what is wrong."""
        return [*check_reward(reward, info["reward_terms"]), *self._check(observation, info)]

    def _check(self, observation: Any, info: dict[str, Any]) -> list[str]:
        before, self._position = self._position, info["pose"][:2].copy()
        boxes_before, self._boxes = self._boxes, self._box_corners()
        wrong = check_observation(observation, self._space)
        wrong += check_info(info, self._keys)
        wrong += check_body(self._walls, before, self._position, self._limits)
        wrong += check_obstacles(
            self._recorder.last.dynamic_obstacles, self._position, self._limits
        )
        wrong += check_boxes(self._walls, boxes_before, self._boxes, self._limits)
        if wrong:
            return wrong  # A wrong observation has no ranges to check.
        return self._check_ranges(observation, info["pose"])

    def _box_corners(self) -> Float64[np.ndarray, "boxes 4 2"]:
        """Return the corners of the boxes (m), whose outlines come after those of the doors."""
        first, number = len(self._movables.doors), len(self._movables.boxes)
        sides = self._recorder.last.dynamic_obstacles[first : first + 4 * number]
        return sides[:, :2].reshape(-1, 4, 2)

    def _check_ranges(self, observation: Any, pose: Pose) -> list[str]:
        """Return what is wrong with the ranges of laser and sonars."""
        moment, observation_config = self._recorder.last, self._observation_config
        wrong: list[str] = []
        if moment.reading.laser is not None:
            seen = np.concatenate((self._opaque, moment.dynamic_obstacles))
            laser, ranges = moment.reading.laser.geometry, moment.reading.laser.ranges
            if "laser" in observation_config.shapes and observation_config.laser_sectors is None:
                ranges = observation_config.decode(LASER, observation)
            mount = compose(pose, np.array(laser.mount))
            wrong += check_laser(seen, mount, laser.bearings, ranges, self._limits)
        if moment.reading.sonar is not None:
            surfaces = np.concatenate((self._walls, moment.dynamic_obstacles))
            wrong += check_sonar(surfaces, pose, moment.reading.sonar, self._limits)
        return wrong
