"""The odometer: what the robot believes about its motion from turning wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_env.sim.drive import Wheels


@dataclass(frozen=True, kw_only=True)
class OdometerConfig:
    """Errors of a wheel-encoder odometer; all zero is a perfect one.

    The systematic errors are those that Borenstein and Feng name (Measurement and
    correction of systematic odometry errors in mobile robots, IEEE Trans. Robotics and
    Automation 12(6), 1996): the odometer computes with wheels and a wheel base that
    the robot does not quite have. The random errors are random walks: their variance
    grows with the way, however often the odometer is read (Thrun, Burgard and Fox,
    Probabilistic Robotics, section 5.4).
    """

    scale_error: float = 0.0
    """Both wheels larger than believed: true distance / measured distance - 1."""
    wheel_difference: float = 0.0
    """Right wheel larger than the left: ratio of their true diameters - 1."""
    wheel_base_error: float = 0.0
    """Wheel base wider than believed: true base / believed base - 1. The caster, which
    resists in turns, works the same way: the robot turns less than measured."""
    heading_bias: float = 0.0
    """Turn (rad/s) measured in excess while the wheels turn."""
    distance_noise: float = 0.0
    """Standard deviation of the distance's random error after one metre (m/√m)."""
    drift_noise: float = 0.0
    """Standard deviation of the heading's random error after one metre (rad/√m)."""
    turn_noise: float = 0.0
    """Standard deviation of the heading's random error after one radian (rad/√rad)."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not math.isfinite(value):
                raise InputError(f"OdometerConfig.{name}", "a finite number", str(value))
            if name.endswith("_noise") and value < 0:
                raise InputError(f"OdometerConfig.{name}", "at least 0", str(value))
            if name in ("scale_error", "wheel_difference", "wheel_base_error") and value <= -1:
                raise InputError(f"OdometerConfig.{name}", "above -1", str(value))


ODOMETERS: Mapping[str, OdometerConfig] = MappingProxyType(
    {
        "ideal": OdometerConfig(),
        "pioneer": OdometerConfig(
            scale_error=0.002,
            wheel_difference=0.0004,
            wheel_base_error=0.005,
            distance_noise=0.01,
            drift_noise=0.023,
            turn_noise=0.03,
        ),
        "poor": OdometerConfig(
            scale_error=0.01,
            wheel_difference=0.002,
            wheel_base_error=0.03,
            distance_noise=0.03,
            drift_noise=0.03,
            turn_noise=0.05,
        ),
    }
)
"""The odometers by name.

`ideal`: no error but that of slipping wheels.

`pioneer`: a calibrated Pioneer on an office floor. After a square of 4 × 25 m it is 4.5 m
off in the median (1.9 to 8 m in four of five runs), as the robot of Hossain's thesis was
(4.6 m after about 100 m; experiment 3): the figures are chosen to give that. The
systematic part, wheels that differ by 0.04 % and a base 0.5 % too wide, makes up less
than half; the rest is random, 1.3° of heading after a metre, 13° after 100 m.

`poor`: worn wheels of unequal pressure and a base out of calibration: 10 to 13 m off after
the same square, by errors of some percent in distance and turn, the order of the
Stage simulator's default `odom_error` (0.03 0.03 0.00 0.05).
"""


class Odometer:
    """Adds up what the wheel encoders count, as the robot's controller does.

    It is rolled with the true motion of the wheels. What the body makes of that it
    cannot know: wheels that slip at a wall count metres all the same.
    """

    def __init__(self, config: OdometerConfig, wheel_base: float) -> None:
        self.config = config
        mean = 1 + config.scale_error
        # Wheels of diameter ratio q = 1 + wheel_difference and given mean diameter.
        self._left_factor = (2 + config.wheel_difference) / 2 / mean
        self._right_factor = (
            (2 + config.wheel_difference) / (2 + 2 * config.wheel_difference) / mean
        )
        self._base = wheel_base / (1 + config.wheel_base_error)
        self.clear()

    def clear(self) -> None:
        """Begin to measure a new motion here."""
        self._x = self._y = self._heading = 0.0
        self._distance = self._turning = 0.0

    def roll(self, wheels: Wheels, duration: float) -> None:
        """Add what the wheels roll at these speeds (m/s) for a physics step (s)."""
        if not (wheels.left or wheels.right):
            return
        left = wheels.left * duration * self._left_factor
        right = wheels.right * duration * self._right_factor
        turn = (right - left) / self._base + self.config.heading_bias * duration
        distance = (left + right) / 2
        half = turn / 2
        chord = distance * math.sin(half) / half if half else distance
        self._x += chord * math.cos(self._heading + half)
        self._y += chord * math.sin(self._heading + half)
        self._heading += turn
        self._distance += abs(distance)
        self._turning += abs(turn)

    def read(self, rng: np.random.Generator) -> Pose:
        """The motion measured since the last reading, in the robot's frame then; begins anew."""
        config = self.config
        noise_along, noise_heading = rng.standard_normal(2)
        along = config.distance_noise * math.sqrt(self._distance) * noise_along
        heading = noise_heading * math.sqrt(
            config.drift_noise**2 * self._distance + config.turn_noise**2 * self._turning
        )
        # The heading's error grew on the way: half of it bends the way itself.
        cos, sin = math.cos(heading / 2), math.sin(heading / 2)
        x, y = self._x, self._y
        reach = math.hypot(x, y)
        if reach:
            x, y = x + along * x / reach, y + along * y / reach
        turned = self._heading + heading
        motion = np.array(
            (cos * x - sin * y, sin * x + cos * y, (turned + math.pi) % (2 * math.pi) - math.pi)
        )
        self.clear()
        return motion
