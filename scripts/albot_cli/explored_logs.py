"""Record logs of simulated robots that explore worlds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import gymnasium

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.engine.engine import Engine
from albot_agents.registry import EXPLORE, check_agent, find_agent
from albot_cli.progress import progress
from albot_core.logs.log import Log
from albot_core.mappers.registry import NO_MAPPER
from albot_env.recording.log import EpisodeLog
from albot_env.tasks.core.single import SingleEnv


@dataclass(frozen=True, kw_only=True)
class Exploration:
    """An agent that explores a world."""

    world: str
    """The world's spec."""
    seed: int
    """Seed of environment and agent."""
    agent: str
    """The agent's name. A scripted agent drives by odometry, without a map."""
    steps: int
    """Number of steps of 0.1 s."""
    sensors: Mapping[str, str]
    """Presets by name of the setting (`laser`, `sonar`, `scenes`, `compass`, `odometer`,
    `robot`)."""

    def make(self) -> gymnasium.Env[Any, Any]:
        """Make its environment.

        Raises:
            InputError: There is no such world, agent or sensor.
        """
        check_agent(self.agent, EXPLORE)
        entry = find_agent(self.agent)
        settings: dict[str, Any] = {"world": self.world, **self.sensors}
        if entry.file is None:
            settings["mapper"] = NO_MAPPER
        settings = entry.environment(EXPLORE, settings)
        return gymnasium.make(
            EXPLORE, max_episode_steps=self.steps, disable_env_checker=True, **settings
        )


def explore(exploration: Exploration, on_step: Callable[[int], None] = lambda _: None) -> Log:
    """Let the agent explore; return the log of its readings and true poses.

    Args:
        exploration: The agent and its world.
        on_step: Called before each step with its number.

    Raises:
        InputError: There is no such world, agent or sensor.
    """
    env = exploration.make()
    inside, kept = env.unwrapped, EpisodeLog()
    assert isinstance(inside, SingleEnv)
    inside.recorder = kept
    try:
        agent = find_agent(exploration.agent).make(EnvironmentConfigs.of(env))
        observation, info = begin_episode(env, agent, exploration.seed)
        for step in range(exploration.steps):
            on_step(step)
            action = choose_action(agent, observation, info)
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
    finally:
        env.close()
    return kept.log(exploration.world)


def explore_all(explorations: Sequence[Exploration], engine: Engine) -> list[Log]:
    """Run explorations in parallel; return their logs in the same order.

    Raises:
        InputError: As `explore`; an error in the first one is raised before any begins.
    """
    explorations[0].make().close()
    logs: dict[int, Log] = {}
    results = engine.run(explore, explorations)
    with progress("exploring", len(explorations), "worlds") as update, closing(results):
        for done in results:
            each = done.task
            logs[done.number] = done.required(f"{each.agent} in {each.world}, seed {each.seed}")
            update(len(logs))
    return [logs[number] for number in range(len(explorations))]
