"""The random agent: the floor that every other agent must rise above."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete

from albot_agents.agent import Action


class Wanderer:
    """Draws an action at random and keeps to it for a second; an answer, each time anew."""

    name: ClassVar[str] = "random"
    knows_truth: ClassVar[bool] = False

    _HOLD = 10
    """Steps for which an action is kept: white noise would only tremble on the spot."""

    def reset(self, rng: np.random.Generator, actions: Box | Discrete) -> None:
        """Begin anew."""
        self._rng = rng
        self._choices = int(actions.n) if isinstance(actions, Discrete) else 0
        self._shape = actions.shape
        self._left = 0

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """An action that does not depend on the observation."""
        if self._choices:
            return np.int64(self._rng.integers(self._choices))
        if self._left == 0:
            self._action = self._rng.uniform(-1, 1, self._shape).astype(np.float32)
            self._left = self._HOLD
        self._left -= 1
        return self._action.copy()
