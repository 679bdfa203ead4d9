"""The explorer of nearest frontiers as an agent: it takes observations, and gives actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from albot_agents.agent import Action
from albot_agents.scripted.driving import DrivingAgent
from albot_core.planning.frontier_explorer import FrontierExplorer
from albot_env.tasks.core.observation import ObservationConfig


class NearestFrontier(DrivingAgent[FrontierExplorer]):
    """Goes to the nearest border of the ground that it has covered. It declares nothing.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "nearest-frontier"

    def __init__(self, observing: ObservationConfig) -> None:
        super().__init__(observing, FrontierExplorer(observing.coverage.radius))

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        return self._drive(self._driver.command(self._sense(observation)))
