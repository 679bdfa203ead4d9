"""The odometer: the robot's motion as measured by its wheel encoders.

A robot's count is a record (`ODOMETER_COUNT`). In each physics step `roll_wheels` adds the wheels'
motion with all systematic errors, without random numbers. `read_odometer` adds the random errors
and restarts the count. An episode begins with a count of zeros and a reading before the wheels
turn; that reading draws the episode's constants.

Random numbers that only some odometers need have counters far beyond those of the readings, so
that every odometer draws the same two numbers per reading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import length_of, rotate, wrap_angle
from albot_core.kernels.compiled import kernel
from albot_core.ranges import NOT_NEGATIVE, Range, check_fields
from albot_env.sim.noise import draw, draw_normals, draw_uniform

_FINITE = Range("a finite number", -math.inf)
_RATIO = Range("a number above -1", -1.0, beyond=True)
_SPREAD = Range("a number within [0, 2)", 0.0, math.nextafter(2.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class OdometerConfig:
    """Errors of a wheel-encoder odometer; the default (all zero) is a perfect one.

    The systematic errors are those of Borenstein and Feng (Measurement and correction of
    systematic odometry errors in mobile robots, IEEE Trans. Robotics and Automation 12(6), 1996):
    the wheel diameters and the wheel base that the odometer computes with differ from the robot's
    true ones. The random errors are random walks: their variance grows with the distance, however
    often the odometer is read (Thrun, Burgard and Fox, Probabilistic Robotics, section 5.4; for
    each wheel's own error: Chong and Kleeman, Accurate odometry and error modelling for a mobile
    robot, ICRA 1997).
    """

    scale_error: float = 0.0
    """Both wheels are larger than believed: true distance / measured distance - 1."""
    wheel_difference: float = 0.0
    """The right wheel is larger than the left: ratio of their true diameters - 1."""
    wheel_base_error: float = 0.0
    """The wheel base is wider than believed: true base / believed base - 1. The robot turns less
    than measured."""
    heading_bias: float = 0.0
    """Excess of the measured turn rate (rad/s) while the wheels turn."""
    distance_noise: float = 0.0
    """Standard deviation of the random distance error after one metre (m/√m)."""
    drift_noise: float = 0.0
    """Standard deviation of the random heading error after one metre (rad/√m)."""
    turn_noise: float = 0.0
    """Standard deviation of the random heading error after one radian (rad/√rad)."""
    wheel_noise: float = 0.0
    """Standard deviation of each wheel's own random slip after one metre (m/√m): it causes a
    distance error and a heading error together."""
    tick: float = 0.0
    """Distance that a wheel rolls per encoder tick (m); 0 means no quantisation. The remainder
    of a reading counts in the next."""
    caster_drag: float = 0.0
    """Unmeasured turn of the robot per rad that the caster swings (rad/rad). It reduces turns
    at their beginning and swings the tail out when the robot reverses (see
    `caster_angle_after`)."""
    slip_rate: float = 0.0
    """Mean number of random wheel slips per metre (1/m)."""
    slip_length: float = 0.0
    """Mean length (m) of a slip, exponentially distributed: measured but not driven. Both wheels
    slip equally often."""
    distance_spread: float = 0.0
    """Width E of the range [1 - E/2, 1 + E/2] from which an episode's ratio of measured to true
    distance is drawn uniformly."""
    turn_spread: float = 0.0
    """The same for the episode's ratio of measured to true turn."""

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

    def constants(self, wheel_base: float) -> OdometerConstants:
        """Return the constants of the compiled odometer, for a wheel base (m)."""
        mean, ratio = 1 + self.scale_error, 1 + self.wheel_difference
        rarer = {
            "wheel_noise": float(self.wheel_noise),
            "tick": float(self.tick),
            "caster_drag": float(self.caster_drag),
            "slip_gap": 1 / self.slip_rate if self.slip_rate else 0.0,
            "slip_length": float(self.slip_length),
            "distance_spread": float(self.distance_spread),
            "turn_spread": float(self.turn_spread),
        }
        return OdometerConstants(
            left=(1 + ratio) / 2 / mean,
            right=(1 + ratio) / (2 * ratio) / mean,
            base=wheel_base / (1 + self.wheel_base_error),
            heading_bias=float(self.heading_bias),
            distance_noise=float(self.distance_noise),
            drift_noise=float(self.drift_noise),
            turn_noise=float(self.turn_noise),
            **rarer,
            has_rarer_errors=any(rarer.values()),
        )


class OdometerConstants(NamedTuple):
    """Constants of the compiled odometer; see `OdometerConfig`."""

    left: float
    """Measured over true distance of the left wheel and of the right wheel, whose diameters have
    the ratio 1 + wheel_difference and the given mean."""
    right: float
    base: float
    """The believed wheel base (m)."""
    heading_bias: float
    distance_noise: float
    drift_noise: float
    turn_noise: float
    wheel_noise: float
    tick: float
    caster_drag: float
    slip_gap: float
    """Mean distance between slips (m); 0 without slips."""
    slip_length: float
    distance_spread: float
    turn_spread: float
    has_rarer_errors: bool
    """Whether any value after `turn_noise` is not zero."""


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

`pioneer`: a calibrated Pioneer on an office floor. Its median error after a square of 4 × 25 m
is 4.5 m (1.9 to 8 m in four of five runs). The values are chosen to match the robot of
Hossain's thesis (4.6 m after about 100 m; experiment 3). The systematic part, wheels that
differ by 0.04 % and a base 0.5 % too wide, is less than half of the error; the rest is random:
1.3° of heading after a metre, 13° after 100 m.

`poor`: unequally worn wheels and an uncalibrated base. The error after the same square is 10 to
13 m, from errors of some percent in distance and turn, like the Stage simulator's default
`odom_error` (0.03 0.03 0.00 0.05).

`carpet`: the same Pioneer on carpet, with encoders of 128 ticks per millimetre (nominal), a
caster that costs one degree at the beginning of a turn and two at a reversal, some slip of
each wheel, and, twice per 100 m, a wheel that spins for centimetres. Caster, slip and spin are
our choice.

`albot1-disturbed`: `pioneer` plus the errors that Hossain added in experiment 3, 0.1 m and 1°
between consecutive views, for views one metre apart.

`stage`: the default of the Stage simulator's position model: proportional errors of distance
and turn, drawn once per episode, uniformly within ±1.5 % and ±2.5 %
(its manual: https://player-stage-manual.readthedocs.io/en/latest/WORLDFILES/, `odom_error
[0.03 0.03 0.00 0.05]`; y and z do not concern a robot on two wheels). Stage treats an
`odom_error` in a world file differently from its manual: as the errors themselves, with the
fourth number in degrees.

`bias-1.5`, `bias-3`, `bias-6`: the constant biases (°/s) of Milford, Prasser and Wyeth's
simulated loops (Experience mapping, ACRA 2005, section 5.2; figures 8 to 10), and no other
error. They make measured left turns too large; the paper does not give the direction.
"""


ODOMETER_COUNT = np.dtype(
    [
        # Counted since the last reading:
        ("x", np.float64),  # position in the robot's frame at that reading (m)
        ("y", np.float64),
        ("heading", np.float64),  # in the same frame (rad)
        ("way", np.float64),  # absolute distance (m)
        ("turning", np.float64),  # absolute turning (rad)
        ("left_way", np.float64),  # absolute distance of each wheel (m)
        ("right_way", np.float64),
        # Kept over the episode:
        ("left_rest", np.float64),  # remainder of each wheel after its last tick (m)
        ("right_rest", np.float64),
        ("caster", np.float64),  # angle of the caster (rad)
        ("slips", np.float64),  # number of slips
        ("rolled", np.float64),  # distance so far (m)
        ("next_slip", np.float64),  # distance at the next slip (m)
        ("distance_ratio", np.float64),  # measured over true distance; 0 until it is drawn
        ("turn_ratio", np.float64),  # measured over true turn; 0 until it is drawn
    ]
)

ODOMETER_DRAWS = 2
"""Number of random numbers that a reading draws."""

_EPISODE: Any = np.int64(2**62)
"""Counter of the episode's two random numbers."""
_SLIPS: Any = np.int64(2**62 + 2)
"""First counter of the slips' random numbers: three per slip."""

CASTER_PIVOT = 0.2
"""Distance L of the caster's pivot behind the axle (m); nominal, as of a Pioneer 3-DX."""
CASTER_TRAIL = 0.03
"""Distance c of the caster's wheel behind the pivot (m); nominal."""
_CASTER_SKEW = math.radians(1.0)
"""Angle by which a caster does not trail quite straight, so reversing straight is unstable."""
_CASTER_STEP = 0.2
"""Maximum step (rad) in which the caster's equation is integrated."""


@kernel()
def roll_wheels(
    count: Any, left: float, right: float, duration: float, errors: OdometerConstants
) -> None:
    """Add the wheels' motion at these speeds (m/s) for `duration` (s) to the count."""
    if left == 0.0 and right == 0.0:
        return
    left *= duration * errors.left
    right *= duration * errors.right
    if errors.has_rarer_errors:
        _roll_with_rarer_errors(count, left, right, duration, errors)
        return
    turn = (right - left) / errors.base + errors.heading_bias * duration
    _move(count, (left + right) / 2, turn)


@kernel()
def _roll_with_rarer_errors(
    count: Any, left: float, right: float, duration: float, errors: OdometerConstants
) -> None:
    """Add the wheels' measured distances (m) in `duration` (s), with the rarer errors too."""
    if errors.tick > 0.0:
        left, count.left_rest = _whole_ticks(left + count.left_rest, errors.tick)
        right, count.right_rest = _whole_ticks(right + count.right_rest, errors.tick)
    turn = (right - left) / errors.base + errors.heading_bias * duration
    distance = (left + right) / 2
    if errors.caster_drag > 0.0:
        angle = caster_angle_after(count.caster, distance, turn)
        turn -= errors.caster_drag * (angle - count.caster)
        count.caster = angle
    count.left_way += abs(left)
    count.right_way += abs(right)
    if count.distance_ratio != 0.0:
        distance, turn = distance * count.distance_ratio, turn * count.turn_ratio
    _move(count, distance, turn)


@kernel()
def _whole_ticks(way: float, tick: float) -> tuple[float, float]:
    """Return the distance (m) of the whole ticks on a wheel's way, and the remainder."""
    whole = math.floor(way / tick) * tick
    return whole, way - whole


@kernel()
def caster_angle_after(angle: float, distance: float, turn: float) -> float:
    """Return the caster's angle after the robot drives `distance` (m) and turns by `turn` (rad).

    The wheel's contact point moves only in the wheel's direction. Let the caster's pivot be a
    length L behind the axle and its wheel a length c behind the pivot, and let the robot drive at
    v and turn at ω. Then the caster's angle ψ (rad, counter-clockwise, 0 when it trails straight
    behind a robot that drives forwards) obeys

        ψ' = -(v sin ψ + ω L cos ψ) / c - ω

    (Campion, Bastin and D'Andréa-Novel, Structural properties and classification of kinematic
    and dynamic models of wheeled mobile robots, IEEE Trans. Robotics and Automation 12(1),
    1996: the constraint of a castor wheel). When the robot reverses, the caster swings round.
    """
    steps = math.ceil(
        (abs(distance) / CASTER_TRAIL + abs(turn) * (1 + CASTER_PIVOT / CASTER_TRAIL))
        / _CASTER_STEP
    )
    for _ in range(steps):
        change = _caster_rate(angle, distance, turn) / steps
        angle += _caster_rate(angle + change / 2, distance, turn) / steps
    return angle


@kernel()
def _caster_rate(angle: float, distance: float, turn: float) -> float:
    """Return the caster's rate, if the whole motion takes one unit of time."""
    along = distance * math.sin(angle - math.copysign(_CASTER_SKEW, distance))
    return -(along + turn * CASTER_PIVOT * math.cos(angle)) / CASTER_TRAIL - turn


@kernel()
def _move(count: Any, distance: float, turn: float) -> None:
    """Add an arc of length `distance` (m) and angle `turn` (rad)."""
    half = turn / 2
    length = distance * math.sin(half) / half if half else distance
    count.x += length * math.cos(count.heading + half)
    count.y += length * math.sin(count.heading + half)
    count.heading += turn
    count.way += abs(distance)
    count.turning += abs(turn)


@kernel()
def read_odometer(
    count: Any, errors: OdometerConstants, key: np.uint64, counter: int, motion: np.ndarray
) -> None:
    """Write the measured motion, with its random error, and restart the count."""
    if count.distance_ratio == 0.0:
        _begin_episode(count, errors, key)
    noise_along, noise_heading = draw_normals(key, counter)
    along, error = _random_errors(count, errors, noise_along, noise_heading)
    if errors.slip_length > 0.0:
        excess, turn = _wheel_slip(count, errors, key)
        along, error = along + excess, error + turn
    # The heading error grew on the way: half of it turns the displacement, too.
    cos, sin = math.cos(error / 2), math.sin(error / 2)
    x, y = count.x, count.y
    reach = length_of(x, y)
    if reach > 0.0:
        x, y = x + along * x / reach, y + along * y / reach
    motion[0], motion[1] = rotate(cos, sin, x, y)
    motion[2] = wrap_angle(count.heading + error)
    count.x = count.y = count.heading = count.way = count.turning = 0.0
    count.left_way = count.right_way = 0.0


@kernel()
def _begin_episode(count: Any, errors: OdometerConstants, key: np.uint64) -> None:
    """Draw the episode's ratios of distance and turn, and the distance to the first slip."""
    count.distance_ratio = 1.0 + errors.distance_spread * (draw_uniform(key, _EPISODE) - 0.5)
    count.turn_ratio = 1.0 + errors.turn_spread * (draw_uniform(key, _EPISODE + 1) - 0.5)
    count.next_slip = errors.slip_gap * _draw_exponential(key, _SLIPS)


@kernel()
def _random_errors(
    count: Any, errors: OdometerConstants, noise_along: float, noise_heading: float
) -> tuple[float, float]:
    """Return random errors of distance (m) and heading (rad) from two standard normal numbers."""
    along = errors.distance_noise * math.sqrt(count.way)
    drift = math.sqrt(errors.drift_noise**2 * count.way + errors.turn_noise**2 * count.turning)
    if errors.wheel_noise == 0.0:
        return along * noise_along, noise_heading * drift
    # Half the sum and the difference of the two wheels' errors are correlated if one wheel rolls
    # farther than the other.
    left = errors.wheel_noise**2 * count.left_way
    right = errors.wheel_noise**2 * count.right_way
    base = errors.base
    drift = math.sqrt(drift**2 + (left + right) / base**2)
    shared = (right - left) / (2 * base) / drift if drift > 0.0 else 0.0
    own = math.sqrt(max(along**2 + (left + right) / 4 - shared**2, 0.0))
    return own * noise_along + shared * noise_heading, drift * noise_heading


@kernel()
def _wheel_slip(count: Any, errors: OdometerConstants, key: np.uint64) -> tuple[float, float]:
    """Return excess distance (m) and heading (rad) from wheel slips since the last reading."""
    count.rolled += (count.left_way + count.right_way) / 2
    along = turn = 0.0
    while count.rolled >= count.next_slip:
        counter = _SLIPS + 3 * int(count.slips)
        length = errors.slip_length * _draw_exponential(key, counter + 1)
        side = 1.0 if draw(key, counter + 2) >> np.uint64(63) else -1.0
        along += length / 2
        turn += side * length / errors.base
        count.slips += 1.0
        count.next_slip += errors.slip_gap * _draw_exponential(key, counter + 3)
    return along, turn


@kernel()
def _draw_exponential(key: np.uint64, counter: int) -> float:
    """Draw from the exponential distribution of mean 1: the waiting time for a rare event."""
    return -math.log(1.0 - draw_uniform(key, counter))
