"""Compiled odometer: what is counted since the last reading, and how it is read.

A robot's count is a row of COUNTS numbers. It begins an episode with zeros, and the
episode with a reading, before the wheels turn: that draws what holds for the episode.
`errors` are the ERRORS numbers of `OdometerConfig.constants`.

Numbers that few odometers need come from places in the robot's stream beyond all that
readings take in turn, so that one with them draws the same two numbers a reading.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.geometry.directions import length_of, wrapped
from albot_core.kernels.compiled import kernel
from albot_env.sim.caster_kernels import swing
from albot_env.sim.noise_kernels import draw, draw_normals

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
WHEEL_NOISE, TICK, CASTER_DRAG, SLIP_GAP, SLIP_LENGTH, DISTANCE_SPREAD, TURN_SPREAD, MORE = range(
    7, 15
)
"""Places in `errors`; see `OdometerConfig.constants`."""
ERRORS = 15
"""Length of `errors`."""

ODOMETER_DRAWS = 2
"""Places in the robot's stream that a reading takes."""

_EPISODE: Any = np.int64(2**62)
"""Where in the stream the episode's two numbers are."""
_SLIPS: Any = np.int64(2**62 + 2)
"""Where in the stream the slips' numbers begin: three for each."""


@kernel()
def roll(count: np.ndarray, left: float, right: float, duration: float, errors: np.ndarray) -> None:
    """Add what the wheels roll at these speeds (m/s) for a while (s)."""
    if left == 0.0 and right == 0.0:
        return
    left *= duration * errors[LEFT]
    right *= duration * errors[RIGHT]
    if errors[MORE] != 0.0:
        _roll_more(count, left, right, duration, errors)
        return
    turn = (right - left) / errors[BASE] + errors[BIAS] * duration
    _move(count, (left + right) / 2, turn)


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
def read(
    count: np.ndarray, errors: np.ndarray, key: np.uint64, place: int, motion: np.ndarray
) -> None:
    """Write the motion measured, with its random error, and begin to count anew."""
    if count[DISTANCE] == 0.0:
        _begin(count, errors, key)
    noise_along, noise_heading = draw_normals(key, place)
    along, error = _stray(count, errors, noise_along, noise_heading)
    if errors[SLIP_LENGTH] > 0.0:
        excess, turn = _slip(count, errors, key)
        along, error = along + excess, error + turn
    # The heading's error grew on the way: half of it bends the way itself.
    cos, sin = math.cos(error / 2), math.sin(error / 2)
    x, y = count[X], count[Y]
    reach = length_of(x, y)
    if reach > 0.0:
        x, y = x + along * x / reach, y + along * y / reach
    motion[0], motion[1] = cos * x - sin * y, sin * x + cos * y
    motion[2] = wrapped(count[HEADING] + error)
    for i in range(RIGHT_WAY + 1):
        count[i] = 0.0


@kernel()
def _roll_more(
    count: np.ndarray, left: float, right: float, duration: float, errors: np.ndarray
) -> None:
    """Add what the wheels roll on these ways (m) in a while (s), with the rarer errors too."""
    if errors[TICK] > 0.0:
        left = _ticked(count, LEFT_REST, left, errors[TICK])
        right = _ticked(count, RIGHT_REST, right, errors[TICK])
    turn = (right - left) / errors[BASE] + errors[BIAS] * duration
    distance = (left + right) / 2
    if errors[CASTER_DRAG] > 0.0:
        angle = swing(count[CASTER], distance, turn)
        turn -= errors[CASTER_DRAG] * (angle - count[CASTER])
        count[CASTER] = angle
    count[LEFT_WAY] += abs(left)
    count[RIGHT_WAY] += abs(right)
    if count[DISTANCE] != 0.0:
        distance, turn = distance * count[DISTANCE], turn * count[TURN]
    _move(count, distance, turn)


@kernel()
def _ticked(count: np.ndarray, rest: int, way: float, tick: float) -> float:
    """The way (m) of whole ticks that pass as a wheel rolls on; the rest is kept."""
    count[rest] += way
    whole: float = math.floor(count[rest] / tick) * tick
    count[rest] -= whole
    return whole


@kernel()
def _begin(count: np.ndarray, errors: np.ndarray, key: np.uint64) -> None:
    """Draw the episode's factors of distance and turn, and the way to the first slip."""
    count[DISTANCE] = 1.0 + errors[DISTANCE_SPREAD] * (_even(key, _EPISODE) - 0.5)
    count[TURN] = 1.0 + errors[TURN_SPREAD] * (_even(key, _EPISODE + 1) - 0.5)
    count[NEXT_SLIP] = errors[SLIP_GAP] * _waiting(key, _SLIPS)


@kernel()
def _stray(
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
def _slip(count: np.ndarray, errors: np.ndarray, key: np.uint64) -> tuple[float, float]:
    """Distance (m) and heading (rad) measured in excess as a wheel spun since the last reading."""
    count[ROLLED] += (count[LEFT_WAY] + count[RIGHT_WAY]) / 2
    along = turn = 0.0
    while count[ROLLED] >= count[NEXT_SLIP]:
        place = _SLIPS + 3 * int(count[SLIPS])
        length = errors[SLIP_LENGTH] * _waiting(key, place + 1)
        side = 1.0 if draw(key, place + 2) >> np.uint64(63) else -1.0
        along += length / 2
        turn += side * length / errors[BASE]
        count[SLIPS] += 1.0
        count[NEXT_SLIP] += errors[SLIP_GAP] * _waiting(key, place + 3)
    return along, turn


@kernel()
def _even(key: np.uint64, place: int) -> float:
    """A number in [0, 1), each as likely as the others."""
    return np.float64(draw(key, place) >> np.uint64(11)) * 2.0**-53


@kernel()
def _waiting(key: np.uint64, place: int) -> float:
    """An exponentially distributed number of mean 1: how long one waits for what is rare."""
    return -math.log(1.0 - _even(key, place))
