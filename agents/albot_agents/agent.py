"""The agent: it chooses a robot's actions in an environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from jaxtyping import Float32

Action = Float32[np.ndarray, "numbers"]
"""Speed and turn rate as shares of what the environment allows, in [-1, 1]. A third number above
0.5 declares home in `Albot/Homing-v0`, and claims to know the place in `Albot/Explore-v0`."""


@runtime_checkable
class Agent(Protocol):
    """Chooses actions from observations."""

    @property
    def name(self) -> str:
        """The name under which `make_agent` finds it."""

    @property
    def knows_truth(self) -> bool:
        """Whether it uses the ground truth in the infos; such an agent is an upper bound only."""

    def reset(self, rng: np.random.Generator, actions: Any) -> None:
        """Begin a new episode: reset all state.

        Args:
            rng: The source of all its randomness.
            actions: The space of the environment's actions.

        Raises:
            InputError: The agent cannot act in such an environment.
        """

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action for an observation, which is a flat array or a dict of parts.

        `info` is the environment's info for agents that know the truth, and empty for others.
        """


def choose_action(agent: Agent, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
    """Return an agent's action; `info` is passed on only if the agent knows the truth."""
    return agent.act(observation, info if agent.knows_truth else {})


def fill_action(driving: Float32[np.ndarray, "2"], actions: Box, *, flag: bool = False) -> Action:
    """Return an action from speed and turn rate; `flag` sets the third number to 1, else -1."""
    (length,) = actions.shape
    action = np.full(length, 1.0 if flag else -1.0, np.float32)
    action[:2] = driving
    return action


def begin_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, seed: int
) -> tuple[Any, dict[str, Any]]:
    """Reset environment and agent; return the first observation and info.

    The agent's generator is derived from `seed`, so that it does not draw the same numbers as the
    environment.
    """
    agent.reset(np.random.default_rng((seed, 1)), env.action_space)
    return env.reset(seed=seed)
