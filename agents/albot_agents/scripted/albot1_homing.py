"""Homing over Albot1's network of places: back through the exits, one place at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action, filled
from albot_agents.scripted.senses import SENSED, make_sense, sense_known_way
from albot_core.exploration.wayfarer import Wayfarer
from albot_core.geometry.poses import inverse
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.observation import ObservationConfig


class Albot1Homing:
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
    knows_truth: ClassVar[bool] = False

    ARRIVED = 0.3
    """How near to where it believes home to be it declares (m)."""

    def __init__(self, observing: ObservationConfig) -> None:
        observing.require(SENSED, self.name)
        self._observing = observing
        self._wayfarer = Wayfarer()

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        self._wayfarer.reset(rng)
        self._actions = actions

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        senses = make_sense(observation, self._observing)
        home = inverse(senses.pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return filled(np.zeros(2, np.float32), self._actions, declares=True)
        known = sense_known_way(observation, self._observing)
        command = self._wayfarer.command(senses, home, known)
        return filled(ActionConfig().shares(command), self._actions)
