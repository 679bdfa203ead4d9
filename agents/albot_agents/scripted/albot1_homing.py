"""Homing over Albot1's network of places: back through the exits, one place at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from albot_agents.agent import Action
from albot_agents.scripted.driving import DrivingAgent
from albot_agents.scripted.senses import sense_known_way
from albot_core.geometry.poses import inverse
from albot_core.planning.navigator import Navigator
from albot_env.tasks.core.observation import ObservationConfig


class Albot1Homing(DrivingAgent[Navigator]):
    """Drives through one exit after another until home is in this place, and there to it.

    It uses only what the map holds: over the network of places the way back to the place that
    it set out from (Hossain 2014, section 4.2.3, brings known places into the perceptual map
    one at a time), within a place the trail that it came by. Where that is much longer than a way
    that it has not seen to be barred, it tries the latter; that is ours. Round what is in the way
    it goes by its laser.

    Args:
        observing: How the environment makes observations. Where they do not show the way home
            (the part `way`), it makes straight for home.
    """

    name: ClassVar[str] = "albot1-homing"

    ARRIVED = 0.3
    """How near to where it believes home to be it declares (m)."""

    def __init__(self, observing: ObservationConfig) -> None:
        super().__init__(observing, Navigator())

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        senses = self._sense(observation)
        home = inverse(senses.pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        known = sense_known_way(observation, self._observing)
        return self._drive(self._driver.command(senses, home, known))
