"""The explorer of nearest frontiers as an agent: it takes observations, and gives actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action, filled
from albot_agents.scripted.senses import SENSED, make_sense
from albot_core.exploration.frontier import FrontierExplorer
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.observation import ObservationConfig


class NearestFrontier:
    """Goes to the nearest border of the ground that it has covered. It declares nothing.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "nearest-frontier"
    knows_truth: ClassVar[bool] = False

    def __init__(self, observing: ObservationConfig) -> None:
        observing.require(SENSED, self.name)
        self._observing = observing
        self._explorer = FrontierExplorer(observing.coverage.radius)

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew, by looking all around."""
        self._actions = actions
        self._explorer.reset(rng)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        senses = make_sense(observation, self._observing)
        return filled(ActionConfig().shares(self._explorer.command(senses)), self._actions)
