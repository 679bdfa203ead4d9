"""The drive of a Pioneer 3-DX: wheel speed limits, acceleration and kinematics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.kernels.compiled import kernel
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields
from albot_maps.world import ROBOT_RADIUS

GRAVITY = 9.81


class Wheels(NamedTuple):
    """One number per driven wheel: speeds (m/s) or distances rolled (m)."""

    left: float
    right: float


STANDSTILL = Wheels(0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """Body and drive of the robot. The defaults are a Pioneer 3-DX that carries a laser.

    The top speed is the one in Hossain's thesis (section 3.2); wheel base, mass and top turn
    rate are nominal. Acceleration, grip, friction and cruising speeds are our choice. The grip
    holds in any curve at any speed, so the wheels slip only when a wall blocks the robot.
    """

    radius: float = ROBOT_RADIUS
    """Radius of the body, a disc centred on the middle of the axle (m)."""
    wheel_base: float = 0.33
    """Distance between the two driven wheels (m)."""
    mass: float = 13.5
    """Mass (kg), spread evenly over the disc."""
    max_speed: float = 1.6
    """Maximum speed of a wheel's rim, and so of the robot (m/s)."""
    max_turn_rate: float = 5.2
    """Maximum turn rate (rad/s), 300°/s."""
    acceleration: float = 1.0
    """Maximum acceleration of a wheel's rim (m/s²)."""
    grip: float = 0.6
    """Friction coefficient of the tyres on the floor; it limits the force of the wheels."""
    hull_friction: float = 0.3
    """Friction coefficient between the body and walls."""
    cruise_speed: float = 0.5
    """Top speed of a start-stop move (m/s)."""
    cruise_turn_rate: float = 1.0
    """Top turn rate of a start-stop turn (rad/s)."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "hull_friction")
        check_fields(self, POSITIVE, *(name for name in vars(self) if name != "hull_friction"))
        if self.cruise_speed > self.max_speed:
            raise InputError(
                "RobotConfig.cruise_speed", "at most max_speed", str(self.cruise_speed)
            )
        if self.cruise_turn_rate > self.max_turn_rate:
            raise InputError(
                "RobotConfig.cruise_turn_rate", "at most max_turn_rate", str(self.cruise_turn_rate)
            )

    @property
    def moment(self) -> float:
        """Moment of inertia of the disc about its centre (kg m²)."""
        return 0.5 * self.mass * self.radius**2

    def wheels_for(self, speed: float, turn_rate: float) -> Wheels:
        """Return the wheel speeds for a (v, ω) command, limited to what the robot can do.

        Speed and turn rate are clipped to the robot's limits. If a wheel would still be too fast,
        both wheels are scaled down together, which keeps the curvature of the path.
        """
        limits = self.max_speed, self.max_turn_rate, self.wheel_base
        return Wheels(*wheels_for(float(speed), float(turn_rate), *limits))

    def targets_for(
        self, commands: Float64[np.ndarray, "robots 2"]
    ) -> Float64[np.ndarray, "robots 2"]:
        """Return the wheel speeds left, right of many (v, ω) commands (see `wheels_for`)."""
        targets = np.empty_like(commands)
        fill_wheel_targets(commands, self.max_speed, self.max_turn_rate, self.wheel_base, targets)
        return targets

    def limited(self, wheels: Wheels) -> Wheels:
        """Return wheel speeds limited to the maximum wheel speed and the maximum turn rate."""
        left, right = _clip(wheels.left, self.max_speed), _clip(wheels.right, self.max_speed)
        turn_rate = abs(right - left) / self.wheel_base
        excess = max(1.0, turn_rate / self.max_turn_rate)
        return Wheels(left / excess, right / excess)

    def motion_of(self, wheels: Wheels) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) of a robot whose wheels do not slip."""
        return (wheels.left + wheels.right) / 2, (wheels.right - wheels.left) / self.wheel_base


PIONEER_3DX = RobotConfig()
"""The robot of the papers."""


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


@kernel()
def wheels_for(
    speed: float, turn_rate: float, top_speed: float, top_turn_rate: float, wheel_base: float
) -> tuple[float, float]:
    """Return the wheel speeds left, right of a (v, ω) command, both scaled down if too fast."""
    speed = min(max(speed, -top_speed), top_speed)
    half = min(max(turn_rate, -top_turn_rate), top_turn_rate) * wheel_base / 2
    excess = max(1.0, (abs(speed) + abs(half)) / top_speed)
    return (speed - half) / excess, (speed + half) / excess


@kernel()
def fill_wheel_targets(
    commands: np.ndarray,
    top_speed: float,
    top_turn_rate: float,
    wheel_base: float,
    targets: np.ndarray,
) -> None:
    """Fill `targets` (n, 2) with the wheel speeds for commands (n, 2) of v (m/s) and ω (rad/s)."""
    for i in range(commands.shape[0]):
        speed, turn_rate = commands[i, 0], commands[i, 1]
        left, right = wheels_for(speed, turn_rate, top_speed, top_turn_rate, wheel_base)
        targets[i, 0], targets[i, 1] = left, right


@kernel()
def ramped(
    left: float, right: float, to_left: float, to_right: float, possible: float
) -> tuple[float, float]:
    """Return the wheel speeds after a change towards the targets of at most `possible` (m/s).

    Both wheels change in proportion, so that a turn on the spot stays a turn on the spot.
    """
    change = max(abs(to_left - left), abs(to_right - right))
    if change <= possible:
        return to_left, to_right
    share = possible / change
    return left + share * (to_left - left), right + share * (to_right - right)


@kernel()
def chord(heading: float, turn: float) -> tuple[float, float]:
    """Return the direction of an arc's chord (rad) and the ratio of chord length to arc length.

    The arc starts at `heading` (rad) and turns by `turn` (rad).
    """
    half = turn / 2
    return heading + half, math.sin(half) / half if half else 1.0
