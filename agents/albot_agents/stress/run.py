"""One episode, watched at every step."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import albot_env  # noqa: F401  (registers the environments)
from albot_agents.agent import choose
from albot_agents.episode import begin_episode
from albot_agents.registry import find_agent, make_agent
from albot_agents.stress.plan import Episode, Violation
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

ENVIRONMENT = "Albot/Explore-v0"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of an episode."""

    episode: Episode
    """The episode."""
    steps: int
    """How many steps were taken: it ends where something is wrong."""
    violations: tuple[Violation, ...]
    """All that was wrong in the last of them."""


class Witness:
    """A recorder of the last moment alone: where things are, and what the sonars said."""

    def begin(self, header: EpisodeHeader) -> None:
        """Begin an episode."""

    def close(self) -> None:
        """Do nothing: there is no file."""

    def add(self, moment: Moment) -> None:
        """Take down the next moment."""
        self.last = moment


class Watch:
    """Looks on, and says what is wrong after a step.

    Args:
        world: The world that the robot is in.
        witness: The environment's recorder.
        space: The space of its observations.
        observing: How they are made of readings.
        limits: What may be.
    """

    def __init__(
        self,
        world: World,
        witness: Witness,
        space: gymnasium.Space[Any],
        observing: ObservationConfig,
        limits: Limits,
    ) -> None:
        self._walls, self._opaque = world.walls, world.opaque
        self._witness = witness
        self._space = space
        self._limits = limits
        self._observing = observing

    def start(self, observation: Any, info: dict[str, Any]) -> list[str]:
        """What is wrong after a reset."""
        self._keys = all_keys(info)
        self._place = info["pose"][:2].copy()
        return self._look(observation, info)

    def step(self, observation: Any, reward: float, info: dict[str, Any]) -> list[str]:
        """What is wrong after a step."""
        return [
            *check_reward(reward, info["reward_terms"]),
            *self._look(observation, info),
        ]

    def _look(self, observation: Any, info: dict[str, Any]) -> list[str]:
        before, self._place = self._place, info["pose"][:2].copy()
        wrong = check_observation(observation, self._space)
        wrong += check_info(info, self._keys)
        wrong += check_body(self._walls, before, self._place, self._limits)
        wrong += check_obstacles(self._witness.last.things, self._place, self._limits)
        if wrong:
            return wrong  # An observation that is none has no ranges to look at.
        return self._listen(observation, info["pose"])

    def _listen(self, observation: Any, pose: Pose) -> list[str]:
        """What is wrong with what the robot senses."""
        moment = self._witness.last
        seen = np.concatenate((self._opaque, moment.things))
        observing, laser = self._observing, self._observing.laser
        ranges = np.asarray(moment.reading.required_laser("albot stress").ranges)
        if "laser" in observing.shapes and observing.laser_sectors is None:
            ranges = observing.ranges(observing.split(observation)["laser"])
        eye = compose(pose, np.array(laser.mount))
        wrong = check_laser(seen, eye, laser.bearings, ranges, self._limits)
        if moment.reading.sonar is not None:
            surfaces = np.concatenate((self._walls, moment.things))
            wrong += check_sonar(surfaces, pose, moment.reading.sonar, self._limits)
        return wrong


def run_episode(episode: Episode, tell: Callable[[int], None], limits: Limits) -> Outcome:
    """Run an episode to its end, or to the first step after which something is wrong.

    An exception in the environment or the agent is something wrong too.

    Args:
        episode: The episode.
        tell: Is called with the number of each step before it is taken, 0 for the reset.
        limits: What may be.
    """
    step = 0
    tell(step)
    try:
        for wrong in _watched(episode, limits):
            if wrong:
                return _outcome(episode, step, wrong)
            step += 1
            tell(step)
    except Exception as error:  # noqa: BLE001  (whatever goes wrong in there is a finding)
        return _outcome(episode, step, [_in_a_line(error)])
    return Outcome(episode=episode, steps=step - 1, violations=())


def _watched(episode: Episode, limits: Limits) -> Iterator[list[str]]:
    """What is wrong after the reset, and after each step."""
    asked = {"world": episode.world, "mapper": episode.mapper, "max_episode_steps": episode.steps}
    settings = find_agent(episode.agent).environment(ENVIRONMENT, asked)
    env = gymnasium.make(ENVIRONMENT, disable_env_checker=True, **settings)
    try:
        observing = env.get_wrapper_attr("observing")
        agent = make_agent(episode.agent, observing)
        witness = Witness()
        env.set_wrapper_attr("recorder", witness)
        world = load_world(episode.world)
        watch = Watch(world, witness, env.observation_space, observing, limits)
        observation, info = begin_episode(env, agent, episode.seed)
        yield watch.start(observation, info)
        over = False
        while not over:
            action = choose(agent, observation, info)
            observation, reward, terminated, truncated, info = env.step(action)
            over = terminated or truncated
            yield watch.step(observation, float(reward), info)
    finally:
        env.close()


def _outcome(episode: Episode, step: int, wrong: list[str]) -> Outcome:
    violations = tuple(Violation(episode=episode, step=step, what=what) for what in wrong)
    return Outcome(episode=episode, steps=step, violations=violations)


def _in_a_line(error: BaseException) -> str:
    """An exception, and the line of code that it came from, in one line."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}{place}"
