"""The odometer: what the robot believes about its motion from turning wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError


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

    def constants(self, wheel_base: float) -> Float64[np.ndarray, "7"]:
        """What the compiled odometer computes with, for wheels so far apart (m).

        Measured over true distance of the left and of the right wheel, wheels of diameter
        ratio 1 + wheel_difference and given mean diameter; the believed wheel base (m);
        the heading's bias; the three noises.
        """
        mean, ratio = 1 + self.scale_error, 1 + self.wheel_difference
        left, right = (1 + ratio) / 2 / mean, (1 + ratio) / (2 * ratio) / mean
        base = wheel_base / (1 + self.wheel_base_error)
        noises = self.distance_noise, self.drift_noise, self.turn_noise
        return np.array((left, right, base, self.heading_bias, *noises))


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
