"""The robot: one body and drive for worlds, simulator, planners and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError, did_you_mean
from albot_core.kernels.compiled import kernel
from albot_core.plain_data import Location, read_config, to_plain
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields


class Wheels(NamedTuple):
    """One number per driven wheel: speeds (m/s) or distances rolled (m)."""

    left: float
    right: float


STANDSTILL = Wheels(0.0, 0.0)
CONTROL_STEP = 0.1
"""Duration of a control step (s): from one command and reading to the next."""


@dataclass(frozen=True, kw_only=True)
class RobotConfig:
    """Body and drive of the robot. The defaults are a Pioneer 3-DX that carries a laser.

    The top speed is the one in Hossain's thesis (section 3.2); wheel base, mass and top turn
    rate are nominal. Acceleration, grip, friction and cruising speeds are our choice. The grip
    holds in any curve at any speed, so the wheels slip only when a wall blocks the robot.
    """

    radius: float = 0.25
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

DEFAULT_ROBOT = "pioneer-3dx"
"""Name of the default robot."""

ROBOTS: Mapping[str, RobotConfig] = MappingProxyType(
    {
        DEFAULT_ROBOT: PIONEER_3DX,
        "kobuki": RobotConfig(
            radius=0.176,
            wheel_base=0.23,
            mass=6.3,
            max_speed=0.7,
            max_turn_rate=3.14,
            cruise_speed=0.4,
        ),
        "peoplebot": RobotConfig(radius=0.34, mass=19.0, max_speed=0.8, max_turn_rate=2.6),
    }
)
"""Robots by name. Fields that a preset does not name are those of the Pioneer.

`pioneer-3dx`: the default. Its radius is that in ARIA's parameter file `p3dx.p`.

`kobuki`: the base of a TurtleBot 2. Diameter 351.5 mm, 0.7 m/s and 180°/s (Kobuki user guide),
wheels 230 mm apart (`kobuki_driver`, appendix "Kobuki Parameters"); the mass is that of a
TurtleBot 2.

`peoplebot`: the base of a Pioneer under a body as high as a person's chest. Radius 340 mm (ARIA's
parameter file `peoplebot-sh-lms1xx.p`); speed, turn rate and mass are nominal.
"""


def choose_robot(robot: object, source: object) -> RobotConfig:
    """Return the robot that a name or a configuration names.

    Args:
        robot: A name in `ROBOTS`; a configuration; or a mapping, as read from JSON or YAML, of
            its fields that differ from the default.
        source: Where it is from, for errors.

    Raises:
        InputError: There is no such robot, or a field is unknown or out of range.
    """
    if isinstance(robot, RobotConfig):
        return robot
    if isinstance(robot, Mapping):
        plain: Any = to_plain(robot)
        return read_config(RobotConfig, plain, Location(source, ("robot",)), PIONEER_3DX)
    if isinstance(robot, str) and robot in ROBOTS:
        return ROBOTS[robot]
    names = ", ".join(ROBOTS)
    found = f"{robot!r}{did_you_mean(robot, ROBOTS) if isinstance(robot, str) else ''}"
    raise InputError(source, f"one of {names}, or a RobotConfig", found[:160], place="robot")


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
