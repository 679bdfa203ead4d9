"""The gap explorer as an agent: it takes observations, and gives actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from albot_agents.agent import Action
from albot_agents.scripted.driving import DrivingAgent
from albot_core.planning.gap_explorer import GapExplorer, GapExplorerConfig
from albot_env.tasks.core.observation import ObservationConfig


class GapExplorerAgent(DrivingAgent[GapExplorer]):
    """Goes from gap to gap, near ones with much new ground first. It declares nothing.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "gap-explorer"

    _GAIN: ClassVar[float] = 4.0
    """Way (m) that ground all new is worth (see `GapExplorerConfig.gain`)."""

    def __init__(self, observing: ObservationConfig) -> None:
        config = GapExplorerConfig(near=observing.coverage.radius, gain=self._GAIN)
        super().__init__(observing, GapExplorer(config))

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        return self._drive(self._driver.command(self._sense(observation)))
