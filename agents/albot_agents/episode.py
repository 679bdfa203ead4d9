"""How an episode begins: a seed decides all of it, whoever runs it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from albot_agents.agent import Agent


def begin_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, seed: int
) -> tuple[Any, dict[str, Any]]:
    """Reset environment and agent; the first observation and info.

    The environment draws from `seed` itself: the agent must not draw the same numbers.
    """
    agent.reset(np.random.default_rng((seed, 1)), env.action_space)
    return env.reset(seed=seed)
