"""The oracle: drives the shortest way home, which it is told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action, filled
from albot_agents.scripted.senses import SENSED, make_sense
from albot_core.exploration.approach import Approach
from albot_core.geometry.poses import inverse, transform_points
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.observation import ObservationConfig


class Oracle:
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
        observing.require(SENSED, self.name)
        self._observing = observing
        self._approach = Approach()

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        self._approach.reset(rng)
        self._actions = actions

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on along the shortest way, or declares home."""
        senses = make_sense(observation, self._observing)
        pose, home = info["pose"], info["start"][:2]
        if np.hypot(*(home - pose[:2])) < self.ARRIVED:
            return filled(np.zeros(2, np.float32), self._actions, declares=True)
        turn = transform_points(inverse(pose), info.get("next_turn_home", home))
        command = self._approach.command(senses, turn)
        return filled(ActionConfig().shares(command), self._actions)
