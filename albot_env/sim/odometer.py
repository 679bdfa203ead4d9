"""The odometer: what the robot believes about its motion from turning wheels.

A robot's count is a row of COUNTS numbers. `roll_wheels` adds to it in each physics step, without
random numbers but with all systematic errors; `read_odometer` adds the random ones and begins to
count anew. It begins an episode with zeros, and the episode with a reading, before the wheels
turn: that draws what holds for the episode.

Numbers that few odometers need have counters beyond all that readings take in turn, so that an
odometer with them draws the same two numbers a reading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float64

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
    (`caster_angle_after` says how it swings)."""
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


X, Y, HEADING, WAY, TURNING, LEFT_WAY, RIGHT_WAY = range(7)
"""Counted since the last reading: position and heading in the robot's frame then (m, rad),
distance and turning without sign (m, rad), and the two wheels' ways without sign (m)."""
LEFT_REST, RIGHT_REST, CASTER, SLIPS, ROLLED, NEXT_SLIP, DISTANCE, TURN = range(7, 15)
"""Kept over the episode: what the wheels rolled beyond their last ticks (m); the caster's
angle (rad); slips so far, the way rolled so far and that at the next slip (m); and the
factors of distance and turn, zero before they are drawn."""
COUNTS = 15
"""Length of a count."""

LEFT, RIGHT, BASE, BIAS, ALONG_NOISE, DRIFT_NOISE, TURN_NOISE = range(7)
WHEEL_NOISE, TICK, CASTER_DRAG, SLIP_GAP, SLIP_LENGTH = range(7, 12)
DISTANCE_SPREAD, TURN_SPREAD, MORE = range(12, 15)
"""Places in `errors`, the numbers of `OdometerConfig.constants`."""

ODOMETER_DRAWS = 2
"""Random numbers that a reading draws."""

_EPISODE: Any = np.int64(2**62)
"""The counter of the episode's two numbers."""
_SLIPS: Any = np.int64(2**62 + 2)
"""The first counter of the slips' numbers: three for each."""

CASTER_PIVOT = 0.2
"""L: distance of the pivot behind the axle (m); nominal, as of a Pioneer 3-DX."""
CASTER_TRAIL = 0.03
"""c: distance of the wheel behind the pivot (m); nominal."""
_CASTER_SKEW = math.radians(1.0)
"""A caster does not trail quite straight, so that reversing straight on it does not balance."""
_CASTER_STEP = 0.2
"""The equation is solved in steps of at most this angle (rad)."""


@kernel()
def roll_wheels(
    count: np.ndarray, left: float, right: float, duration: float, errors: np.ndarray
) -> None:
    """Add what the wheels roll at these speeds (m/s) for a while (s)."""
    if left == 0.0 and right == 0.0:
        return
    left *= duration * errors[LEFT]
    right *= duration * errors[RIGHT]
    if errors[MORE] != 0.0:
        _roll_with_rarer_errors(count, left, right, duration, errors)
        return
    turn = (right - left) / errors[BASE] + errors[BIAS] * duration
    _move(count, (left + right) / 2, turn)


@kernel()
def _roll_with_rarer_errors(
    count: np.ndarray, left: float, right: float, duration: float, errors: np.ndarray
) -> None:
    """Add what the wheels roll on these ways (m) in a while (s), with the rarer errors too."""
    if errors[TICK] > 0.0:
        left = _whole_ticks(count, LEFT_REST, left, errors[TICK])
        right = _whole_ticks(count, RIGHT_REST, right, errors[TICK])
    turn = (right - left) / errors[BASE] + errors[BIAS] * duration
    distance = (left + right) / 2
    if errors[CASTER_DRAG] > 0.0:
        angle = caster_angle_after(count[CASTER], distance, turn)
        turn -= errors[CASTER_DRAG] * (angle - count[CASTER])
        count[CASTER] = angle
    count[LEFT_WAY] += abs(left)
    count[RIGHT_WAY] += abs(right)
    if count[DISTANCE] != 0.0:
        distance, turn = distance * count[DISTANCE], turn * count[TURN]
    _move(count, distance, turn)


@kernel()
def _whole_ticks(count: np.ndarray, rest: int, way: float, tick: float) -> float:
    """The way (m) of whole ticks that pass as a wheel rolls on; the rest is kept."""
    count[rest] += way
    whole: float = math.floor(count[rest] / tick) * tick
    count[rest] -= whole
    return whole


@kernel()
def caster_angle_after(angle: float, distance: float, turn: float) -> float:
    """The caster's angle after the robot drives so far (m) while it turns so much (rad).

    The wheel's point of contact moves only where the wheel points. With the caster's pivot a
    length L behind the axle, its wheel a length c behind the pivot, and the robot driving at v
    and turning at ω, the caster's angle ψ (rad, counter-clockwise, 0 as it trails when the
    robot drives on) obeys

        ψ' = -(v sin ψ + ω L cos ψ) / c - ω

    (Campion, Bastin and D'Andréa-Novel, Structural properties and classification of kinematic
    and dynamic models of wheeled mobile robots, IEEE Trans. Robotics and Automation 12(1),
    1996: the constraint of a castor wheel). When the robot reverses, it swings right round.
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
    """How fast the caster swings, as the whole motion takes one unit of time."""
    along = distance * math.sin(angle - math.copysign(_CASTER_SKEW, distance))
    return -(along + turn * CASTER_PIVOT * math.cos(angle)) / CASTER_TRAIL - turn


@kernel()
def _move(count: np.ndarray, distance: float, turn: float) -> None:
    """Add an arc of this length (m) and turn (rad)."""
    half = turn / 2
    length = distance * math.sin(half) / half if half else distance
    count[X] += length * math.cos(count[HEADING] + half)
    count[Y] += length * math.sin(count[HEADING] + half)
    count[HEADING] += turn
    count[WAY] += abs(distance)
    count[TURNING] += abs(turn)


@kernel()
def read_odometer(
    count: np.ndarray, errors: np.ndarray, key: np.uint64, counter: int, motion: np.ndarray
) -> None:
    """Write the motion measured, with its random error, and begin to count anew."""
    if count[DISTANCE] == 0.0:
        _begin_episode(count, errors, key)
    noise_along, noise_heading = draw_normals(key, counter)
    along, error = _random_errors(count, errors, noise_along, noise_heading)
    if errors[SLIP_LENGTH] > 0.0:
        excess, turn = _wheel_slip(count, errors, key)
        along, error = along + excess, error + turn
    # The heading's error grew on the way: half of it bends the way itself.
    cos, sin = math.cos(error / 2), math.sin(error / 2)
    x, y = count[X], count[Y]
    reach = length_of(x, y)
    if reach > 0.0:
        x, y = x + along * x / reach, y + along * y / reach
    motion[0], motion[1] = rotate(cos, sin, x, y)
    motion[2] = wrap_angle(count[HEADING] + error)
    for i in range(RIGHT_WAY + 1):
        count[i] = 0.0


@kernel()
def _begin_episode(count: np.ndarray, errors: np.ndarray, key: np.uint64) -> None:
    """Draw the episode's factors of distance and turn, and the way to the first slip."""
    count[DISTANCE] = 1.0 + errors[DISTANCE_SPREAD] * (draw_uniform(key, _EPISODE) - 0.5)
    count[TURN] = 1.0 + errors[TURN_SPREAD] * (draw_uniform(key, _EPISODE + 1) - 0.5)
    count[NEXT_SLIP] = errors[SLIP_GAP] * _draw_exponential(key, _SLIPS)


@kernel()
def _random_errors(
    count: np.ndarray, errors: np.ndarray, noise_along: float, noise_heading: float
) -> tuple[float, float]:
    """The random errors of distance (m) and heading (rad) from two normal numbers."""
    along = errors[ALONG_NOISE] * math.sqrt(count[WAY])
    drift = math.sqrt(
        errors[DRIFT_NOISE] ** 2 * count[WAY] + errors[TURN_NOISE] ** 2 * count[TURNING]
    )
    if errors[WHEEL_NOISE] == 0.0:
        return along * noise_along, noise_heading * drift
    # Half the sum and the difference of the two wheels' errors, which go together where
    # one wheel rolls farther than the other.
    left = errors[WHEEL_NOISE] ** 2 * count[LEFT_WAY]
    right = errors[WHEEL_NOISE] ** 2 * count[RIGHT_WAY]
    base = errors[BASE]
    drift = math.sqrt(drift**2 + (left + right) / base**2)
    shared = (right - left) / (2 * base) / drift if drift > 0.0 else 0.0
    own = math.sqrt(max(along**2 + (left + right) / 4 - shared**2, 0.0))
    return own * noise_along + shared * noise_heading, drift * noise_heading


@kernel()
def _wheel_slip(count: np.ndarray, errors: np.ndarray, key: np.uint64) -> tuple[float, float]:
    """Distance (m) and heading (rad) measured in excess as a wheel spun since the last reading."""
    count[ROLLED] += (count[LEFT_WAY] + count[RIGHT_WAY]) / 2
    along = turn = 0.0
    while count[ROLLED] >= count[NEXT_SLIP]:
        counter = _SLIPS + 3 * int(count[SLIPS])
        length = errors[SLIP_LENGTH] * _draw_exponential(key, counter + 1)
        side = 1.0 if draw(key, counter + 2) >> np.uint64(63) else -1.0
        along += length / 2
        turn += side * length / errors[BASE]
        count[SLIPS] += 1.0
        count[NEXT_SLIP] += errors[SLIP_GAP] * _draw_exponential(key, counter + 3)
    return along, turn


@kernel()
def _draw_exponential(key: np.uint64, counter: int) -> float:
    """An exponentially distributed number of mean 1: how long one waits for what is rare."""
    return -math.log(1.0 - draw_uniform(key, counter))
