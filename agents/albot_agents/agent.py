"""The agent: what drives a robot in an environment."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32

Action = Float32[np.ndarray, "2"]
"""Speed and turn rate as shares of what the environment allows, in [-1, 1]."""


@runtime_checkable
class Agent(Protocol):
    """Chooses actions from observations, and from nothing else."""

    @property
    def name(self) -> str:
        """The name under which `make_agent` finds it."""

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything: a new episode begins. `rng` is the source of all its randomness."""

    def act(self, observation: Any) -> Action:
        """The action after an observation, flat or by part."""
