"""The explorer: drives to one goal after another, and gives up those that it cannot reach."""

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
    """Looks around, then drives from goal to goal. Subclasses choose the goals.

    Args:
        coverage_range: Largest distance at which visible ground counts as covered (m).
        steering: The steering parameters.
    """

    _PLAN_EVERY = 9
    """Steps between two path searches."""
    _ARRIVED = 0.3
    """Distance to the end of the route at which the goal counts as reached (m)."""

    def __init__(self, coverage_range: float, steering: SteeringConfig) -> None:
        self._coverage_range = coverage_range
        self._steering = steering

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state, and begin with a full turn to look around."""
        self._rng = rng
        radius, coverage_range = self._steering.robot.radius, self._coverage_range
        config = OccupancyGridConfig(robot_radius=radius, coverage_range=coverage_range)
        self._grid = OccupancyGrid(config)
        self._look_round = LookRound()
        self._stall = StallDetector()
        self._goal: Float64[np.ndarray, "2"] | None = None
        self._route: Float64[np.ndarray, "cells 2"] = np.empty((0, 2))
        self._steps = 0

    def command(self, percept: Percept) -> Command:
        """Return the next drive command for the current percept."""
        self._observe(percept)
        return admissible_command(
            self._desired_command(percept), percept.points, percept.motion, self._steering
        )

    def _desired_command(self, percept: Percept) -> Command:
        """Return the next command before the braking limits apply."""
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
        """Integrate the scan into the grid."""
        self._grid.integrate(percept)
        self._steps += 1

    def _maybe_drop_goal(self, percept: Percept) -> None:
        """Drop the goal if it is reached or unreachable; start a recovery turn if stuck."""
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
        """Exclude a goal from later choices."""

    @abstractmethod
    def _plan(self, percept: Percept) -> None:
        """Search the path to the goal again; choose a goal if there is none."""


class LookRound:
    """A full turn on the spot, at the beginning and after each `begin`."""

    _RATE = 1.6
    """Turn rate (rad/s)."""

    def __init__(self) -> None:
        self._heading: float | None = None
        self.begin()

    def begin(self) -> None:
        """Start another full turn."""
        self._left = 2 * np.pi

    def command(self, pose: Pose) -> Command | None:
        """Update with the current pose; return the command to turn, or None when done."""
        heading = float(pose[2])
        if self._heading is not None:
            self._left -= abs(float(wrap_angle(heading - self._heading)))
        self._heading = heading
        return np.array((0.0, self._RATE)) if self._left > 0 else None


class StallDetector:
    """Detects that a target takes too many steps, or that the robot hardly moves."""

    _STANDSTILL_STEPS = 45
    """Steps within `_STANDSTILL` after which the robot is stuck; any turn takes fewer."""
    _STANDSTILL = 0.15
    """Distance that counts as standing still (m)."""
    _STEPS_PER_METRE = 40
    """Steps allowed per metre of the path."""
    _RECOVERY_STEPS = 12
    """Steps of a recovery turn."""

    def __init__(self) -> None:
        self._allowed = 0
        self._anchor: np.ndarray | None = None
        self._still = 0
        self._recovering = 0
        self._spin = 0.0

    def start(self, length: float) -> None:
        """Start for a new target; `length` is the length of the path to it (m)."""
        self._allowed = 100 + int(self._STEPS_PER_METRE * length)
        self._anchor = None

    def update(self, pose: Pose) -> bool:
        """Update with the current pose; return whether the target must be given up."""
        self._allowed -= 1
        if self._anchor is None or np.hypot(*(pose[:2] - self._anchor)) > self._STANDSTILL:
            self._anchor, self._still = pose[:2], 0
        self._still += 1
        return self._allowed < 0 or self._still > self._STANDSTILL_STEPS

    def start_recovery(self, rng: np.random.Generator) -> None:
        """Start a recovery turn to a random side."""
        self._recovering = self._RECOVERY_STEPS
        self._spin = float(rng.choice((-1.0, 1.0)))

    def recovery_command(self) -> Command | None:
        """Return the next command of the recovery turn; None when done."""
        if self._recovering == 0:
            return None
        self._recovering -= 1
        return np.array((0.0, self._spin))
