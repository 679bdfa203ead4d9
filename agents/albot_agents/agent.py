"""The agent: what drives a robot in an environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from jaxtyping import Float32

Action = Float32[np.ndarray, "numbers"]
"""Speed and turn rate as shares of what the environment allows, in [-1, 1], and what else its
actions hold: in `Albot/Homing-v0` a number that declares home above 0.5, in `Albot/Explore-v0` one
that claims to know the place."""


@runtime_checkable
class Agent(Protocol):
    """Chooses actions from observations."""

    @property
    def name(self) -> str:
        """The name under which `make_agent` finds it."""

    @property
    def knows_truth(self) -> bool:
        """Whether it chooses by the truth in the infos: a bound for the others, no rival."""

    def reset(self, rng: np.random.Generator, actions: Any) -> None:
        """Forget everything: a new episode begins.

        Args:
            rng: The source of all its randomness.
            actions: The space of the environment's actions.

        Raises:
            InputError: It cannot act in such an environment.
        """

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """The action after an observation, flat or by part.

        `info` is the environment's for agents that know the truth, and empty for all others.
        """


def choose_action(agent: Agent, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
    """The action of an agent, which is shown the truth only where it says that it knows it."""
    return agent.act(observation, info if agent.knows_truth else {})


def fill_action(driving: Float32[np.ndarray, "2"], actions: Box, *, says: bool = False) -> Action:
    """Speed and turn rate as an action of this space; `says` goes into a third number."""
    (length,) = actions.shape
    action = np.full(length, 1.0 if says else -1.0, np.float32)
    action[:2] = driving
    return action


def begin_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, seed: int
) -> tuple[Any, dict[str, Any]]:
    """Reset environment and agent; the first observation and info.

    The environment draws from `seed` itself: the agent must not draw the same numbers.
    """
    agent.reset(np.random.default_rng((seed, 1)), env.action_space)
    return env.reset(seed=seed)
