"""Followers: the simplest agents that come home, each a rule of a few lines.

They are baselines: what a planner or a learner adds is what it does better than these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Space

from albot_agents.agent import Action, Commands, EnvironmentConfigs
from albot_core.geometry.types import Points
from albot_env.tasks.core.parts.beliefs import EXIT_HOME, HOME, WAY
from albot_env.tasks.core.parts.sensors import LASER


class HomeVectorFollower:
    """Turns to where home is believed to be, and drives there straight.

    It follows the home vector of each observation, so what the mapper corrects on the way counts;
    `path-integration` takes that of the first observation, and goes on by the odometer alone. It
    turns away from what the laser sees near, and makes no detour: where a wall stands between it
    and home, it stays there.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack one of `PARTS`.
    """

    name: ClassVar[str] = "home-vector"
    knows_truth: ClassVar[bool] = False

    PARTS: ClassVar[tuple[str, ...]] = (LASER.name, HOME.name)
    """The parts of an observation that it needs."""
    ARRIVED = 0.3
    """Distance to the estimated home at which it declares home (m)."""
    NEAR, CREEPING = 0.5, 0.15
    """Range below which it turns away (m), and its speed then (m/s)."""
    SPEED, TURN_FIRST = 0.5, 0.5
    """Its speed else (m/s), and the bearing above which it turns on the spot (rad)."""
    GAIN, TURN = 1.5, 1.0
    """Turn rate per radian of bearing (1/s), and the largest turn rate (rad/s)."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        configs.observations.require(self.PARTS, self.name)
        self._config = configs.observations
        self._commands = Commands(configs.actions)

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode.

        Raises:
            InputError: The actions are not those of the environment's action config.
        """
        self._commands.reset(actions, self.name)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        home, ranges = (self._config.decode(part, observation) for part in (HOME, LASER))
        if math.hypot(*home) < self.ARRIVED:
            return self._commands.action(np.zeros(2), says="declare")
        nearest, middle = int(np.argmin(ranges)), (len(ranges) - 1) / 2
        if ranges[nearest] < self.NEAR:  # Beams run from right to left.
            away = self.TURN if nearest < middle else -self.TURN
            return self._commands.action(np.array((self.CREEPING, away)))
        ahead, left = self._goal(observation, home)
        bearing = math.atan2(left, ahead)
        speed = self.SPEED if abs(bearing) < self.TURN_FIRST else 0.0
        turn = min(max(self.GAIN * bearing, -self.TURN), self.TURN)
        return self._commands.action(np.array((speed, turn)))

    def _goal(self, observation: Any, home: Points) -> Points:
        """Return the point to drive to (m, robot's frame)."""
        return home


class HintFollower(HomeVectorFollower):
    """Turns to the planner's hint, and drives there straight: to `way`, else `exit`, else home."""

    name: ClassVar[str] = "hint-follower"

    PARTS: ClassVar[tuple[str, ...]] = (LASER.name, HOME.name, EXIT_HOME.name, WAY.name)

    def _goal(self, observation: Any, home: Points) -> Points:
        hints = (self._config.decode(part, observation) for part in (WAY, EXIT_HOME))
        return next((hint for hint in hints if hint is not None), home)
