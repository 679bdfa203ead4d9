"""Homing over Albot1's network of places: back through the exits, one place at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action, filled
from albot_agents.scripted.senses import make_sense, sense_exit
from albot_core.exploration.wayfarer import Wayfarer
from albot_core.geometry.poses import inverse
from albot_core.geometry.types import Points
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.observation import ObservationConfig


class Albot1Homing:
    """Drives through the next exit on the believed way home until home is in this place.

    It uses only what the map holds: the next exit of the route over the network of places
    (Hossain 2014, section 4.2.3: places are brought into the perceptual map one at a time),
    and in the last place where home is. Round what is in the way it goes by its laser.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "albot1-homing"
    knows_truth: ClassVar[bool] = False

    ARRIVED = 0.2
    """How near to where it believes home to be it declares (m)."""
    BEYOND = 0.7
    """How far beyond an exit it aims (m): one that is not gone through is not crossed."""
    WAITS = 50
    """Steps that it stands beyond an exit which the map does not see crossed…"""
    IGNORES = 300
    """…before it makes straight for home for so many."""

    def __init__(self, observing: ObservationConfig) -> None:
        self._observing = observing
        self._wayfarer = Wayfarer()

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        self._wayfarer.reset(rng)
        self._actions = actions
        self._waited = 0
        self._ignoring = 0

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        senses = make_sense(observation, self._observing)
        home = inverse(senses.pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return filled(np.zeros(2, np.float32), self._actions, declares=True)
        target = self._beyond_next_exit(observation)
        command = self._wayfarer.command(senses, home if target is None else target)
        return filled(ActionConfig().shares(command), self._actions)

    def _beyond_next_exit(self, observation: Any) -> Points | None:
        """Where to go through the next exit (m, robot's frame); None where none is to be taken."""
        exit_ahead = sense_exit(observation, self._observing)
        if exit_ahead is None or self._ignoring:
            self._ignoring = max(0, self._ignoring - 1)
            return None
        middle, through = exit_ahead
        target = middle + self.BEYOND * through
        self._waited = self._waited + 1 if np.hypot(*target) < 0.5 else 0
        if self._waited > self.WAITS:
            self._waited, self._ignoring = 0, self.IGNORES
        return np.asarray(target)
