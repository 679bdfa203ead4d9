"""Out and back: explores while there is time, and is home before it is up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action
from albot_agents.scripted.albot1_homing import Albot1Homing
from albot_agents.scripted.gap_explorer import GapExplorerAgent
from albot_agents.scripted.senses import sense_time_left, sense_travel_home
from albot_env.tasks.core.observation import ObservationConfig


class RoundTripAgent:
    """Explores as the gap explorer does, and turns back as `albot1-homing` while there is time.

    How long the way home is it takes from the confidence that the mapper has in it, which falls
    with its length.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "round-trip"
    knows_truth: ClassVar[bool] = False

    SPEED = 0.35
    """It reckons to come home so fast (m/s)…"""
    SPARE = 15.0
    """…and with so much time to spare (s)."""

    def __init__(self, observing: ObservationConfig) -> None:
        self._observing = observing
        self._explorer = GapExplorerAgent(observing)
        self._homer = Albot1Homing(observing)

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew: explore.

        Raises:
            InputError: The environment shows no time left, or no confidence.
        """
        self._observing.require(("time_left", "confidence"), self.name)
        self._explorer.reset(rng, actions)
        self._homer.reset(rng, actions)
        self._returns = False

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        left = sense_time_left(observation, self._observing)
        travel = sense_travel_home(observation, self._observing)
        self._returns |= left < self.SPARE + travel / self.SPEED
        return (self._homer if self._returns else self._explorer).act(observation, info)
