"""Path integration: home as the odometer has it, and no map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action
from albot_agents.scripted.driving import DrivingAgent
from albot_core.geometry.poses import compose, inverse
from albot_core.geometry.types import Pose
from albot_core.planning.navigator import GoalSeeker
from albot_env.tasks.core.observation import ObservationConfig


class PathIntegration(DrivingAgent[GoalSeeker]):
    """Follows its home vector round what is in the way, and declares where the vector is nothing.

    From the first observation it takes where home is believed to be, and from there on adds up
    the odometer alone. With the mapper `none` inside, what is believed first is what
    the odometer has added up on the way out: then no map is in it at all.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "path-integration"

    ARRIVED = 0.2
    """The home vector is nothing where it is shorter than this (m)."""

    def __init__(self, observing: ObservationConfig) -> None:
        super().__init__(observing, GoalSeeker())

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        super().reset(rng, actions)
        self._pose: Pose | None = None

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        senses = self._sense(observation)
        self._pose = senses.pose if self._pose is None else compose(self._pose, senses.motion)
        home = inverse(self._pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        return self._drive(self._driver.command(senses, home))
