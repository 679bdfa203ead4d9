"""Teachers: agents that show a learner what to do, and the environments in which they do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from jaxtyping import Bool, Float32, Int64

from albot_agents.agent import Action, EnvironmentConfigs
from albot_agents.registry import AgentEntry, find_agent, make_agent
from albot_agents.task import config_kind
from albot_core.errors import InputError
from albot_core.mappers.registry import NO_MAPPER, mapper_spec
from albot_env.tasks.core.observation import PART_NAMES, parts_by_map
from albot_env.tasks.core.parts.matches import MATCHES
from albot_env.tasks.core.parts.sensors import LASER

Integers = Int64[np.ndarray, "robots"]
Actions = Float32[np.ndarray, "robots numbers"] | Int64[np.ndarray, "robots"]
Observations = Mapping[str, Float32[np.ndarray, "robots ..."]]


class Teachers:
    """An agent for each robot of a batch.

    Args:
        name: Name of the agent.
        configs: The environment's configurations.
        actions: The space of one robot's actions.
        robots: Number of robots.

    Raises:
        InputError: The agent cannot act with such observations or actions.
    """

    def __init__(self, name: str, configs: EnvironmentConfigs, actions: Any, robots: int) -> None:
        self._agents = [make_agent(name, configs) for _ in range(robots)]
        self._actions = actions
        self.begin(0)

    def begin(self, seed: int) -> None:
        """Begin new episodes for all robots; the seed decides what the agents draw in all."""
        self._rngs = [np.random.default_rng((seed, k)) for k in range(len(self._agents))]
        self.reset(np.ones(len(self._agents), np.bool_))

    def reset(self, mask: Bool[np.ndarray, "robots"]) -> None:
        """Begin new episodes for the robots in a mask."""
        for k in np.flatnonzero(mask):
            self._agents[k].reset(self._rngs[k].spawn(1)[0], self._actions)

    def act(
        self,
        observations: Observations,
        robots: Integers,
        infos: Mapping[str, Any] | None = None,
    ) -> Actions:
        """Return the actions of some robots.

        Args:
            observations: What these robots observe, by part.
            robots: Numbers of the robots.
            infos: Infos of the batch, for agents that know the truth.
        """
        chosen: list[Action | np.int64] = []
        for row, k in enumerate(robots.tolist()):
            agent = self._agents[k]
            info = _of(infos, k) if agent.knows_truth and infos is not None else {}
            seen = {part: values[row] for part, values in observations.items()}
            chosen.append(agent.act(seen, info))
        kind = np.float32 if np.ndim(chosen[0]) else np.int64
        return np.asarray(chosen, kind)


class TaughtEnvironments:
    """A batch of environments with a teacher in each, who may observe more than the learner does.

    If so, the same episodes run twice in step, once with the observations of each: an episode
    depends on the seed and the actions, not on what is observed of it.

    Args:
        task: Id of the task.
        agent: Name of the teacher.
        count: Number of environments.
        settings: Settings of the learner's environments.

    Raises:
        InputError: The teacher is not for the task, or lacks a part of observations.
    """

    def __init__(self, task: str, agent: str, count: int, settings: Mapping[str, Any]) -> None:
        entry = find_agent(agent)
        if not entry.attempts(task):
            raise InputError("agent", f"one for {task}", f"one for {' and '.join(entry.tasks)}")
        self.batch: Any = _make(task, count, settings)
        """The environments, as the learner observes them."""
        self._shown = self.batch
        try:
            config = _teacher_config(task, entry, settings, self.batch)
            if config is not None:
                self._shown = _make(task, count, {**settings, "config": config})
            self._check_actions()
            names = "observation_config", "action_config", "robot_config"
            configs = EnvironmentConfigs(*(getattr(self._shown, name) for name in names))
            self._teachers = Teachers(agent, configs, self.batch.single_action_space, count)
        except InputError:
            self.close()
            raise
        self._robots = np.arange(count)

    def reset(self, seed: int) -> Float32[np.ndarray, "robots length"]:
        """Begin new episodes; return the learner's observations."""
        observations, infos = self.batch.reset(seed=seed)
        same = self._shown is self.batch
        self._remember(*((observations, infos) if same else self._shown.reset(seed=seed)))
        self._teachers.begin(seed)
        return np.asarray(observations)

    def demonstrate(self) -> Actions:
        """Return what the teachers would do now."""
        return self._teachers.act(self._seen, self._robots, self._infos)

    def step(self, actions: Actions) -> tuple[Any, ...]:
        """Take a step; return what the learner's batch returns."""
        results = self.batch.step(actions)
        shown = results if self._shown is self.batch else self._shown.step(actions)
        observations, _, ended, truncated, infos = shown
        assert (ended == results[2]).all(), "the same episodes"
        assert (truncated == results[3]).all(), "the same episodes"
        self._remember(observations, infos)
        self._teachers.reset(ended | truncated)
        return tuple(results)

    def close(self) -> None:
        """Close the environments."""
        self.batch.close()
        if self._shown is not self.batch:
            self._shown.close()

    def _remember(self, observations: np.ndarray, infos: Mapping[str, Any]) -> None:
        """Keep what the teachers see and are told."""
        self._seen = self._shown.observation_config.split_rows(observations)
        self._infos = infos

    def _check_actions(self) -> None:
        """Raise InputError if the teacher's actions are not the learner's."""
        its, mine = self._shown.single_action_space, self.batch.single_action_space
        if its != mine:
            raise InputError("agent", f"one with the actions {mine}", str(its))


def _make(task: str, count: int, settings: Mapping[str, Any]) -> Any:
    settings = {"autoreset_mode": AutoresetMode.SAME_STEP, **settings}
    return gymnasium.make_vec(task, num_envs=count, **settings).unwrapped


def _teacher_config(
    task: str, entry: AgentEntry, settings: Mapping[str, Any], batch: Any
) -> Any | None:
    """Return the task's configuration with the teacher's observations; None to use the learner's.

    Args:
        task: Id of the task.
        entry: The teacher.
        settings: Settings of the learner's environments.
        batch: These environments.
    """
    config = settings.get("config") or config_kind(task)()
    if not hasattr(config, "observations"):
        return None
    if entry.file is not None:
        # Its observations alone: with its scales of actions the robots would drive elsewhere.
        its = entry.environment(task, settings)["config"]
        shown = {"hints": its.hints} if hasattr(its, "hints") else {}
        return replace(config, observations=its.observations, **shown)
    seen, uses = batch.observation_config, set(entry.uses)
    mapper = settings.get("mapper", "albot1")
    spec = None if mapper == NO_MAPPER else mapper_spec(mapper)
    if "claim" not in batch.action_config.names or MATCHES.name not in parts_by_map(spec):
        uses.discard(MATCHES.name)
    missing = [part for part in PART_NAMES if part in uses and part not in seen.parts]
    if not missing and (seen.laser_sectors is None or LASER.name not in uses):
        return None
    sectors = None if LASER.name in uses else seen.laser_sectors
    seen = replace(seen, parts=(*seen.parts, *missing), laser_sectors=sectors)
    hints = {"hints": True} if hasattr(config, "hints") else {}
    return replace(config, observations=seen, **hints)


def _of(infos: Mapping[str, Any], k: int) -> dict[str, Any]:
    """Return the values in a batch's infos that are of environment k."""
    return {
        name: values[k]
        for name, values in infos.items()
        if isinstance(values, np.ndarray) and not name.startswith("_")
    }
