"""The odometer: what the robot believes about its motion from turning wheels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.ranges import NOT_NEGATIVE, Range, check_fields

_FINITE = Range("a finite number", -math.inf)
_RATIO = Range("a number above -1", -1.0, beyond=True)
_SPREAD = Range("a number within [0, 2)", 0.0, math.nextafter(2.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class OdometerConfig:
    """Errors of a wheel-encoder odometer; all zero is a perfect one.

    The systematic errors are those that Borenstein and Feng name (Measurement and
    correction of systematic odometry errors in mobile robots, IEEE Trans. Robotics and
    Automation 12(6), 1996): the odometer computes with wheels and a wheel base that
    the robot does not quite have. The random errors are random walks: their variance
    grows with the way, however often the odometer is read (Thrun, Burgard and Fox,
    Probabilistic Robotics, section 5.4; for a wheel of its own: Chong and Kleeman,
    Accurate odometry and error modelling for a mobile robot, ICRA 1997).
    """

    scale_error: float = 0.0
    """Both wheels larger than believed: true distance / measured distance - 1."""
    wheel_difference: float = 0.0
    """Right wheel larger than the left: ratio of their true diameters - 1."""
    wheel_base_error: float = 0.0
    """Wheel base wider than believed: true base / believed base - 1. The robot turns less
    than measured."""
    heading_bias: float = 0.0
    """Turn (rad/s) measured in excess while the wheels turn."""
    distance_noise: float = 0.0
    """Standard deviation of the distance's random error after one metre (m/√m)."""
    drift_noise: float = 0.0
    """Standard deviation of the heading's random error after one metre (rad/√m)."""
    turn_noise: float = 0.0
    """Standard deviation of the heading's random error after one radian (rad/√rad)."""
    wheel_noise: float = 0.0
    """Standard deviation of each wheel's own random slip after one metre (m/√m): an error of
    distance and of heading together."""
    tick: float = 0.0
    """Way of a wheel from one tick of its encoder to the next (m); 0 counts without steps.
    What is left over from a reading counts in the next."""
    caster_drag: float = 0.0
    """How far the swinging caster turns the robot, unmeasured: rad for each rad of swing. It
    holds turns up at their beginning and throws the tail out when the robot reverses
    (`caster_kernels` says how it swings)."""
    slip_rate: float = 0.0
    """How often a wheel spins: times on a metre, on average (1/m), at random."""
    slip_length: float = 0.0
    """How far it spins then, which is measured but not driven: mean length (m) of an
    exponential distribution. Each wheel is as likely."""
    distance_spread: float = 0.0
    """Width E of the range [1 - E/2, 1 + E/2] from which an episode's factor of distance is
    drawn, each number as likely: measured / true."""
    turn_spread: float = 0.0
    """The same of the episode's factor of turn."""

    def __post_init__(self) -> None:
        ratios = "scale_error", "wheel_difference", "wheel_base_error"
        spreads = "distance_spread", "turn_spread"
        check_fields(self, _RATIO, *ratios)
        check_fields(self, _SPREAD, *spreads)
        check_fields(self, _FINITE, "heading_bias")
        rest = (name for name in vars(self) if name not in (*ratios, *spreads, "heading_bias"))
        check_fields(self, NOT_NEGATIVE, *rest)
        if (self.slip_rate > 0) != (self.slip_length > 0):
            expected = "both slip_rate and slip_length above 0, or neither"
            raise InputError("OdometerConfig.slip_length", expected, str(self.slip_length))

    def constants(self, wheel_base: float) -> Float64[np.ndarray, "15"]:
        """What the compiled odometer computes with, for wheels so far apart (m).

        Measured over true distance of the left and of the right wheel, wheels of diameter
        ratio 1 + wheel_difference and given mean diameter; the believed wheel base (m);
        the heading's bias; the three noises; the wheels' noise; the tick; the caster's drag; the
        mean way between slips (m) and their mean length; the two spreads; whether any of
        those after the third noise is not zero.
        """
        mean, ratio = 1 + self.scale_error, 1 + self.wheel_difference
        left, right = (1 + ratio) / 2 / mean, (1 + ratio) / (2 * ratio) / mean
        base = wheel_base / (1 + self.wheel_base_error)
        noises = self.distance_noise, self.drift_noise, self.turn_noise
        slips = 1 / self.slip_rate if self.slip_rate else 0.0, self.slip_length
        spreads = self.distance_spread, self.turn_spread
        rarer = (self.wheel_noise, self.tick, self.caster_drag, *slips, *spreads)
        return np.array((left, right, base, self.heading_bias, *noises, *rarer, any(rarer)))


_CALIBRATED = OdometerConfig(
    scale_error=0.002,
    wheel_difference=0.0004,
    wheel_base_error=0.005,
    distance_noise=0.01,
    drift_noise=0.023,
    turn_noise=0.03,
)

ODOMETERS: Mapping[str, OdometerConfig] = MappingProxyType(
    {
        "ideal": OdometerConfig(),
        "pioneer": _CALIBRATED,
        "poor": OdometerConfig(
            scale_error=0.01,
            wheel_difference=0.002,
            wheel_base_error=0.03,
            distance_noise=0.03,
            drift_noise=0.03,
            turn_noise=0.05,
        ),
        "carpet": replace(
            _CALIBRATED,
            tick=1 / 128e3,
            wheel_noise=0.003,
            caster_drag=0.01,
            slip_rate=0.02,
            slip_length=0.02,
        ),
        "albot1-disturbed": replace(_CALIBRATED, scale_error=-0.0893, wheel_difference=-0.00484),
        "stage": OdometerConfig(distance_spread=0.03, turn_spread=0.05),
        "bias-1.5": OdometerConfig(heading_bias=math.radians(1.5)),
        "bias-3": OdometerConfig(heading_bias=math.radians(3.0)),
        "bias-6": OdometerConfig(heading_bias=math.radians(6.0)),
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

`carpet`: the same Pioneer on carpet, with encoders of 128 ticks a millimetre (nominal), a
caster that costs a degree at the beginning of a turn and two at a reversal, some slip
of each wheel, and twice in 100 m one that spins for centimetres. The last three are ours.

`albot1-disturbed`: what Hossain added in experiment 3, 0.1 m and 1° between consecutive
views, for views a metre apart, on top of `pioneer`.

`stage`: the default of the Stage simulator's position model: proportional errors of
distance and turn, drawn for an episode and then constant, evenly within ±1.5 % and ±2.5 %
(its manual: https://player-stage-manual.readthedocs.io/en/latest/WORLDFILES/, `odom_error
[0.03 0.03 0.00 0.05]`; y and z do not concern a robot on two wheels). A world file's own
`odom_error` Stage takes for the errors themselves, and its fourth number for degrees,
whatever its manual says.

`bias-1.5`, `bias-3`, `bias-6`: the constant biases (°/s) of Milford, Prasser and Wyeth's
simulated loops (Experience mapping, ACRA 2005, section 5.2; figures 8 to 10), and no other
error. Measured turns to the left are too large by them; the paper does not say which way.
"""
