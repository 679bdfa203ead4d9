"""Leading a robot whose true pose is known from waypoint to waypoint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Points, Pose
from albot_core.planning.steering import Command
from albot_core.ranges import POSITIVE, check_fields

_ARRIVED = 0.15
"""A waypoint is reached within this distance (m)."""
_STEERING = 3.0
"""Turn rate for each radian between the robot's heading and the waypoint's direction (1/s)."""
_TURN_FIRST = math.radians(45.0)
"""If a waypoint is farther than this to the side, the robot turns on the spot (rad)."""


@dataclass(frozen=True, kw_only=True)
class Driving:
    """Speeds at which a robot is led. The thesis's was driven by a laptop's arrow keys."""

    speed: float = 0.5
    """Speed straight on (m/s)."""
    turn_rate: float = np.radians(30.0)
    """Maximum turn rate (rad/s)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "speed", "turn_rate")

    def command_towards(self, waypoint: Points, pose: Pose) -> Command | None:
        """Return the command that drives straight towards a waypoint; None once it is reached.

        Args:
            waypoint: The waypoint (2,) (m, world frame).
            pose: True pose of the robot (world frame).
        """
        to = waypoint - pose[:2]
        if np.hypot(*to) <= _ARRIVED:
            return None
        aside = float(wrap_angle(math.atan2(to[1], to[0]) - pose[2]))
        forwards = max(0.0, 1.0 - abs(aside) / _TURN_FIRST)
        turn_rate = float(np.clip(_STEERING * aside, -self.turn_rate, self.turn_rate))
        return np.array((self.speed * forwards, turn_rate))


LED = Driving()
"""The usual speeds."""
