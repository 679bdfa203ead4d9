"""The gap explorer as an agent: it takes observations, and gives actions."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from albot_agents.agent import Action
from albot_agents.scripted.senses import make_sense
from albot_core.exploration.gap_explorer import GapExplorer, GapExplorerConfig
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.observation import ObservationConfig


class GapExplorerAgent:
    """Goes from gap to gap, the nearest first, and back to those passed by.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "gap-explorer"

    def __init__(self, observing: ObservationConfig) -> None:
        self._observing = observing
        self._explorer = GapExplorer(GapExplorerConfig(near=observing.coverage.radius))

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, by looking all around."""
        self._explorer.reset(rng)

    def act(self, observation: Any) -> Action:
        """The next action."""
        senses = make_sense(observation, self._observing)
        return ActionConfig().shares(self._explorer.command(senses))
