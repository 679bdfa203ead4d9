"""Transitions: an episode as offline reinforcement learning takes it."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Space
from jaxtyping import Bool, Float64

from albot_core.errors import InputError
from albot_env.tasks.core.spec import ConfiguredSpec

Observations = np.ndarray | dict[str, np.ndarray]
"""What was observed at each moment, along the first axis; by name where it comes in parts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Transitions:
    """One episode of T steps."""

    spec: Mapping[str, Any]
    """The spec of its environment as JSON has it; its `world` is that of this episode."""
    observation_space: Space[Any]
    """The space of its observations."""
    action_space: Space[Any]
    """The space of its actions."""
    seed: int
    """Seed of its reset."""
    agent: str
    """Name of the agent; empty if unknown."""
    observations: Observations
    """The T + 1 observations: that of the reset, and one after each step."""
    actions: np.ndarray
    """The T actions, as given (see `exact_action`)."""
    rewards: Float64[np.ndarray, "T"]
    """The reward of each step."""
    terminations: Bool[np.ndarray, "T"]
    """Whether the task was over after each step."""
    truncations: Bool[np.ndarray, "T"]
    """Whether the episode was broken off after each step."""


class TransitionsLog:
    """Takes down the transitions of one episode as it runs.

    Args:
        spec: The spec of its environment, with the world of this episode.
        observation_space: The space of its observations.
        action_space: The space of its actions.
        seed: Seed of its reset.
        agent: Name of the agent.
        observation: The observation of the reset.
    """

    def __init__(
        self,
        *,
        spec: Mapping[str, Any],
        observation_space: Space[Any],
        action_space: Space[Any],
        seed: int,
        agent: str,
        observation: Any,
    ) -> None:
        self._about: dict[str, Any] = {
            "spec": spec,
            "observation_space": observation_space,
            "action_space": action_space,
            "seed": seed,
            "agent": agent,
        }
        self._observations = [copy.deepcopy(observation)]
        self._actions: list[np.ndarray] = []
        self._rewards: list[float] = []
        self._ends: list[tuple[bool, bool]] = []

    def action(self, action: Any) -> np.ndarray:
        """Return an action as it is kept (see `exact_action`).

        Raises:
            InputError: It has another number of elements than actions have.
        """
        space = self._about["action_space"]
        numbers = np.asarray(action)
        if numbers.size != np.prod(space.shape or (), dtype=int):
            raise InputError("action", str(space), f"shape {numbers.shape}")
        return exact_action(space, numbers)

    def add(
        self, action: Any, observation: Any, reward: float, terminated: bool, truncated: bool
    ) -> None:
        """Take down a step: the action, and what came of it."""
        self._actions.append(self.action(action))
        self._observations.append(copy.deepcopy(observation))
        self._rewards.append(float(reward))
        self._ends.append((bool(terminated), bool(truncated)))

    def transitions(self) -> Transitions:
        """Return the episode so far, of at least one step.

        If it is not over, it counts as truncated here, as in Minari's collector.
        """
        terminations, truncations = np.array(self._ends, np.bool_).T.copy()
        truncations[-1] |= not terminations[-1]
        return Transitions(
            **self._about,
            observations=_stacked(self._observations),
            actions=np.stack(self._actions),
            rewards=np.array(self._rewards, np.float64),
            terminations=terminations,
            truncations=truncations,
        )


def exact_action(space: Space[Any], action: Any) -> np.ndarray:
    """Return an action in its space's type and shape; in double precision if that rounds it.

    So the action that is kept is the one that was taken, to the last bit, even where an agent
    computes with more digits than its space has.
    """
    given = np.asarray(action).reshape(space.shape or ())
    with np.errstate(invalid="ignore", over="ignore"):
        kept = given.astype(space.dtype)
    return kept if np.array_equal(kept, given) else given.astype(np.float64)


def environment_spec(task: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the spec of an environment as JSON has it.

    Args:
        task: Id of the environment.
        settings: The arguments of `gymnasium.make`, with the world; it is a spec, not an object.

    Raises:
        InputError: JSON cannot hold a setting.
    """
    kwargs = dict(settings)
    spec = ConfiguredSpec.of(gymnasium.spec(task))
    spec.max_episode_steps = kwargs.pop("max_episode_steps", spec.max_episode_steps)
    spec.disable_env_checker = True  # Which would read each observation twice.
    spec.kwargs = spec.kwargs | kwargs
    plain: dict[str, Any] = json.loads(spec.to_json())
    return plain


def spec_from_plain(plain: Mapping[str, Any]) -> EnvSpec:
    """Return a spec from what `environment_spec` returns."""
    return EnvSpec.from_json(json.dumps(plain))


def _stacked(observations: list[Any]) -> Observations:
    if isinstance(observations[0], Mapping):
        return {name: np.stack([each[name] for each in observations]) for name in observations[0]}
    return np.stack(observations)
