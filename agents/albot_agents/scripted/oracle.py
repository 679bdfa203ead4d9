"""The oracle: drives the shortest way home, which it is told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from albot_agents.agent import Action
from albot_agents.scripted.driving import DrivingAgent
from albot_core.geometry.poses import inverse, transform_points
from albot_core.planning.navigator import GoalSeeker
from albot_env.tasks.core.observation import ObservationConfig


class Oracle(DrivingAgent[GoalSeeker]):
    """The upper bound: knows the truth, and still has to drive.

    It takes from `info` where the robot is (`pose`), where it set out (`start`) and where the
    shortest way home turns next (`next_turn_home`); outside `Albot/Homing-v0` it heads
    straight for the start.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "oracle"
    knows_truth: ClassVar[bool] = True

    ARRIVED = 0.2
    """How near to home it stops (m)."""

    def __init__(self, observing: ObservationConfig) -> None:
        super().__init__(observing, GoalSeeker())

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on along the shortest way, or declares home."""
        senses = self._sense(observation)
        pose, home = info["pose"], info["start"][:2]
        if np.hypot(*(home - pose[:2])) < self.ARRIVED:
            return self._declare()
        turn = transform_points(inverse(pose), info.get("next_turn_home", home))
        return self._drive(self._driver.command(senses, turn))
