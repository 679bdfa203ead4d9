"""The explorer: goes for one goal after another, and gives up those that it cannot reach."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose
from albot_core.planning.occupancy_grid import OccupancyGrid, OccupancyGridConfig
from albot_core.planning.percept import Percept
from albot_core.planning.steering import Command, SteeringConfig, admissible_command, steer


class Explorer(ABC):
    """Looks round, and then goes from goal to goal. Subclasses choose the goals.

    Args:
        near: Ground in view and no farther away than this is covered (m).
        steering: How closely to pass things, and how fast.
    """

    _PLAN_EVERY = 9
    """Steps between two searches for the path."""
    _ARRIVED = 0.3
    """The robot has reached a goal when it is so near to the end of the route (m)."""

    def __init__(self, near: float, steering: SteeringConfig) -> None:
        self._near = near
        self._steering = steering

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew, by looking all around."""
        self._rng = rng
        self._grid = OccupancyGrid(OccupancyGridConfig(near=self._near))
        self._look_round = LookRound()
        self._stall = StallDetector()
        self._goal: Float64[np.ndarray, "2"] | None = None
        self._route: Float64[np.ndarray, "cells 2"] = np.empty((0, 2))
        self._steps = 0

    def command(self, percept: Percept) -> Command:
        """How to drive next, by what is sensed now."""
        self._observe(percept)
        return admissible_command(
            self._desired_command(percept), percept.points, percept.motion, self._steering
        )

    def _desired_command(self, percept: Percept) -> Command:
        """The next command, before the robot brakes for anything."""
        turning = self._look_round.command(percept.pose)
        if turning is None:
            turning = self._stall.recovery_command()
        if turning is not None:
            return turning
        self._maybe_drop_goal(percept)
        if self._goal is None or self._steps % self._PLAN_EVERY == 0:
            self._plan(percept)
        ahead = percept.to_robot(self._grid.lookahead_point(percept.pose, self._route))
        return steer(self._grid.obstacles_around(percept), ahead, self._steering)

    def _observe(self, percept: Percept) -> None:
        """Mark what is in view."""
        self._grid.integrate(percept)
        self._steps += 1

    def _maybe_drop_goal(self, percept: Percept) -> None:
        """Drop the goal where it was reached, or cannot be; turn away where the robot is stuck."""
        if self._goal is None:
            return
        stuck = self._stall.update(percept.pose)
        ahead = self._route[-1] - percept.pose[:2] if len(self._route) else np.full(2, np.inf)
        if stuck or np.hypot(*ahead) < self._ARRIVED:
            self._give_up(self._goal)
            self._goal = None
        if stuck:
            self._stall.start_recovery(self._rng)

    @abstractmethod
    def _give_up(self, goal: Float64[np.ndarray, "2"]) -> None:
        """Do not choose this goal again."""

    @abstractmethod
    def _plan(self, percept: Percept) -> None:
        """Find the path to the goal anew; choose a goal where there is none."""


class LookRound:
    """A full turn on the spot, once at the beginning and whenever asked for."""

    _RATE = 1.6
    """How fast it turns (rad/s)."""

    def __init__(self) -> None:
        self._heading: float | None = None
        self.begin()

    def begin(self) -> None:
        """Turn all round once more."""
        self._left = 2 * np.pi

    def command(self, pose: Pose) -> Command | None:
        """Take in the next step's pose; return the command to turn, or None when done."""
        heading = float(pose[2])
        if self._heading is not None:
            self._left -= abs(float(wrap_angle(heading - self._heading)))
        self._heading = heading
        return np.array((0.0, self._RATE)) if self._left > 0 else None


class StallDetector:
    """Limits the steps towards a target, and the steps in which the robot hardly moves."""

    _STANDSTILL_STEPS = 45
    """Steps within a hand's breadth after which the robot is stuck: longer than any turn."""
    _STANDSTILL = 0.15
    """That hand's breadth (m)."""
    _STEPS_PER_METRE = 40
    """Steps allowed for each metre of the path."""
    _RECOVERY_STEPS = 12
    """Steps of turning away."""

    def __init__(self) -> None:
        self._allowed = 0
        self._anchor: np.ndarray | None = None
        self._still = 0
        self._recovering = 0
        self._spin = 0.0

    def start(self, length: float) -> None:
        """Set out for a target; `length` is that of the path there (m)."""
        self._allowed = 100 + int(self._STEPS_PER_METRE * length)
        self._anchor = None

    def update(self, pose: Pose) -> bool:
        """Take in the next step's pose; return whether the target is to be given up."""
        self._allowed -= 1
        if self._anchor is None or np.hypot(*(pose[:2] - self._anchor)) > self._STANDSTILL:
            self._anchor, self._still = pose[:2], 0
        self._still += 1
        return self._allowed < 0 or self._still > self._STANDSTILL_STEPS

    def start_recovery(self, rng: np.random.Generator) -> None:
        """Begin to turn for a while, to a side drawn at random."""
        self._recovering = self._RECOVERY_STEPS
        self._spin = float(rng.choice((-1.0, 1.0)))

    def recovery_command(self) -> Command | None:
        """The next command of that turn; None when done."""
        if self._recovering == 0:
            return None
        self._recovering -= 1
        return np.array((0.0, self._spin))
