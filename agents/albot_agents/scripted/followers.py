"""Followers: the simplest agents that come home or explore, each a rule of a few lines.

They are baselines: what a planner or a learner adds is what it does better than these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Space

from albot_agents.agent import Action, Commands, EnvironmentConfigs
from albot_agents.scripted.driving import decode_recognition
from albot_core.geometry.types import Points
from albot_core.planning.steering import Command
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.beliefs import EXIT_HOME, HOME, PLACE, WAY
from albot_env.tasks.core.parts.ground import ONWARD
from albot_env.tasks.core.parts.sensors import LASER, MOTION


class _Follower:
    """Turns to a point, drives there straight, and turns away from what the laser sees near.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack one of `PARTS`.
    """

    name: ClassVar[str]
    knows_truth: ClassVar[bool] = False

    PARTS: ClassVar[tuple[str, ...]]
    """The parts of an observation that it needs."""
    NEAR, CREEPING = 0.5, 0.15
    """Range below which it turns away (m), and its speed then (m/s)."""
    FRONT: ClassVar[float] = math.pi
    """Largest bearing, to either side, of what it turns away from (rad)."""
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

    def _towards(self, goal: Points, observation: Any) -> Command:
        """Return the command that drives on to a point (m, robot's frame)."""
        ranges = self._config.decode(LASER, observation)
        laser = self._config.laser
        assert laser is not None, "a robot without a laser shows no part of that name"
        # Beams run from right to left, and so do the sectors of which the nearest may be shown.
        last = laser.first_bearing + (laser.beams - 1) * laser.spacing
        bearings = np.linspace(laser.first_bearing, last, len(ranges))
        ranges = np.where(np.abs(bearings) <= self.FRONT, ranges, np.inf)
        nearest, middle = int(np.argmin(ranges)), (len(ranges) - 1) / 2
        if ranges[nearest] < self.NEAR:
            away = self.TURN if nearest < middle else -self.TURN
            return np.array((self.CREEPING, away))
        ahead, left = goal
        bearing = math.atan2(left, ahead)
        speed = self.SPEED if abs(bearing) < self.TURN_FIRST else 0.0
        turn = min(max(self.GAIN * bearing, -self.TURN), self.TURN)
        return np.array((speed, turn))


class HomeVectorFollower(_Follower):
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

    PARTS: ClassVar[tuple[str, ...]] = (LASER.name, HOME.name)
    ARRIVED = 0.3
    """Distance to the estimated home at which it declares home (m)."""

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        home = self._config.decode(HOME, observation)
        if math.hypot(*home) < self.ARRIVED:
            return self._commands.action(np.zeros(2), says="declare")
        return self._commands.action(self._towards(self._goal(observation, home), observation))

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


class OnwardFollower(_Follower):
    """Explores by turning to the planner's hint `onward`, and driving there straight.

    It turns on the spot where there is no way on. It has no memory, so a policy that observes what
    it does can learn to act like it; `gap-explorer`, which remembers the gaps that it has passed,
    cannot be imitated so well. It claims to know a place where its mapper does.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack one of `PARTS`.
    """

    name: ClassVar[str] = "onward-follower"

    PARTS: ClassVar[tuple[str, ...]] = (LASER.name, ONWARD.name)
    OBSERVATIONS: ClassVar[ObservationConfig] = ObservationConfig(
        parts=(LASER.name, MOTION.name, ONWARD.name, PLACE.name)
    )
    """What it observes if nothing else is asked for."""
    NEAR, CREEPING = 0.35, 0.08  # A way may lead through a doorway of 0.9 m.
    FRONT = math.radians(75.0)
    SPEED, GAIN, TURN = 0.6, 2.0, 1.5

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action."""
        onward = self._config.decode(ONWARD, observation)
        turn = np.array((0.0, self.TURN))
        command = turn if onward is None else self._towards(onward, observation)
        knows = decode_recognition(observation, self._config)
        return self._commands.action(command, says="claim" if knows else "")
