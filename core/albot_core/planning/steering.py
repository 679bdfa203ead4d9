"""Steering: how to drive towards a point near by without touching what the laser sees.

`steer` chooses a direction with free way and a speed; `admissible_command` then holds the robot
back where it could not brake in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import length_of, wrap_angle
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.ranges import POSITIVE, check_fields

Command = Float64[np.ndarray, "2"]
"""Speed (m/s) and turn rate (rad/s, counter-clockwise)."""
_COUNT = 180
"""How many directions are considered."""
_SPACING = 2 * math.pi / _COUNT
DIRECTIONS = np.linspace(-np.pi, np.pi, _COUNT, endpoint=False)
"""The directions that are considered (rad)."""
_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the speed wanted that are tried where braking would come too late."""
_SAME = 0.005
"""Things that come nearer by no more than this (m) count as no nearer: ranges are noisy."""
_LEAST = 0.015
"""…but not where less than this (m) is left: many such steps would end in touching them."""
_FARTHEST = 1.5
"""Within this the robot comes to a stand from any speed (m)."""
_PIECES = 4
"""Pieces of a control step in which the robot is taken to drive evenly."""


@dataclass(frozen=True, kw_only=True)
class SteeringConfig:
    """How closely the robot passes things, and how fast."""

    radius: float = 0.33
    """The robot's own radius and what it keeps clear beside it (m)."""
    tight: float = 0.28
    """The same where there is no way otherwise that leads more or less to the target (m)."""
    lookahead: float = 1.0
    """Free way wanted in a direction before it is taken (m)."""
    braking: float = 0.5
    """Deceleration that the speed leaves room for (m/s²)."""
    body: float = 0.25
    """The robot's own radius (m)."""
    speed: float = 1.0
    """Greatest speed (m/s)."""
    turn_rate: float = 2.0
    """Greatest turn rate (rad/s)."""
    creep: float = 0.3
    """Speed past things that are all but touched (m/s)."""
    ease: float = 2.5
    """How much faster for each metre that the nearest thing is farther away (1/s)."""
    gain: float = 2.0
    """Turn rate asked for each radian off the direction (1/s)."""
    pivot: float = 0.7
    """Farther off the direction than this the robot turns on the spot (rad)."""
    margin: float = 0.04
    """What is left between the robot and anything, at least, should it brake now (m)."""
    acceleration: float = 1.0
    """Greatest change of a wheel's speed in a second, of a Pioneer 3-DX (m/s²)."""
    wheel_base: float = 0.33
    """Distance between its driven wheels (m)."""
    step: float = 0.1
    """Duration of a step (s)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *(field.name for field in fields(self)))

    @cached_property
    def limits(self) -> Limits:
        """These numbers as the compiled loops take them."""
        return Limits(*(getattr(self, name) for name in Limits._fields))


class Limits(NamedTuple):
    """The numbers of `SteeringConfig`, in its order."""

    radius: float
    tight: float
    lookahead: float
    braking: float
    body: float
    speed: float
    turn_rate: float
    creep: float
    ease: float
    gain: float
    pivot: float
    margin: float
    acceleration: float
    wheel_base: float
    step: float


def steer(
    points: Float64[np.ndarray, "beams 2"],
    target: Float64[np.ndarray, "2"],
    config: SteeringConfig = SteeringConfig(),
) -> Command:
    """The command that brings the robot towards `target` without touching anything.

    Of the directions with enough free way it takes the one nearest to the target's, and
    turns on the spot where that is far off or where there is none. The points must be all
    around the robot: without the corner that it has just turned away from, it would turn back.

    Args:
        points: Obstacles in view, and remembered ones behind (m, robot's frame).
        target: Where to go (m, robot's frame).
        config: How closely to pass, and how fast.
    """
    x, y = target.tolist()
    return np.array(_steer_towards(points, x, y, config.limits))


@kernel(arrays=True)
def _steer_towards(points: np.ndarray, x: float, y: float, s: Limits) -> tuple[float, float]:
    """The command of `steer` towards the target x, y (m, robot's frame)."""
    distance, bearing = length_of(x, y), math.atan2(y, x)
    way = np.empty(_COUNT)
    direction, least = bearing, math.inf
    for radius in (s.radius, s.tight):
        _find_free_distances(points, radius, _FARTHEST, way)
        for k in range(_COUNT):
            if way[k] >= min(s.lookahead, distance):
                candidate = k * _SPACING - math.pi
                off = abs(wrap_angle(candidate - bearing))
                if off < least:
                    direction, least = candidate, off
        if least <= s.pivot:
            break
    if least == math.inf:
        return 0.0, math.copysign(s.turn_rate, bearing)
    turn_rate = min(max(s.gain * direction, -s.turn_rate), s.turn_rate)
    if abs(direction) > s.pivot:
        return 0.0, turn_rate
    nearest = math.inf
    for i in range(points.shape[0]):
        nearest = min(nearest, length_of(points[i, 0], points[i, 1]))
    room = min(way[_COUNT // 2], distance + 0.2)
    speed = min(
        s.speed,
        math.sqrt(2 * s.braking * room),
        s.creep + s.ease * max(0.0, nearest - s.body),
    )
    return speed * math.cos(direction) ** 2, turn_rate


def free_distances(
    points: Float64[np.ndarray, "beams 2"], radius: float
) -> Float64[np.ndarray, "directions"]:
    """How far (m) a disc can go in each of `DIRECTIONS` before it touches a point."""
    way = np.empty(_COUNT)
    _find_free_distances(points, radius, np.inf, way)
    return way


@kernel()
def _find_free_distances(
    points: np.ndarray, radius: float, farthest: float, way: np.ndarray
) -> None:
    """How far (m) a disc can go in each of `DIRECTIONS`, into `way`.

    Points farther away than `farthest` are ignored.
    """
    for k in range(_COUNT):
        way[k] = math.inf
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        away = math.sqrt(x * x + y * y)
        if away >= farthest:
            continue
        # A point that is already nearer than the radius must not bar the way along it.
        reach = min(radius, 0.97 * away)
        bearing = math.atan2(y, x)
        spread = math.asin(reach / away) if away > 0 else math.pi
        first = math.ceil((bearing - spread + math.pi) / _SPACING)
        last = math.floor((bearing + spread + math.pi) / _SPACING)
        for k in range(first, last + 1):
            off = bearing + math.pi - k * _SPACING
            aside = away * math.sin(off)
            free = away * math.cos(off) - math.sqrt(max(reach * reach - aside * aside, 0.0))
            way[k % _COUNT] = max(0.0, min(way[k % _COUNT], free))


def admissible_command(
    command: Command,
    points: Float64[np.ndarray, "beams 2"],
    motion: Pose,
    config: SteeringConfig = SteeringConfig(),
) -> Command:
    """The command, or one near it after which the robot can still brake before all it sees.

    After the dynamic window of Fox, Burgard and Thrun (The dynamic window approach to
    collision avoidance, IEEE Robotics & Automation Magazine 4(1), 1997): commands from
    which the robot cannot brake in time are not admissible. It gives up speed first, then
    the turn, which bends the way on which it brakes.

    Args:
        command: What is wanted.
        points: Where the laser's beams end (m, robot's frame).
        motion: How the robot moved in the last step.
        config: How closely it may pass, and how it brakes.
    """
    ahead, _, turned = motion.tolist()
    now, (speed, turn_rate) = (ahead / config.step, turned / config.step), command.tolist()
    return np.array(_find_admissible_command(points, now, (speed, turn_rate), config.limits))


@kernel(arrays=True)
def _find_admissible_command(
    points: np.ndarray, motion: tuple[float, float], command: tuple[float, float], s: Limits
) -> tuple[float, float]:
    """The command of `admissible_command`; `motion` is speed and turn rate now."""
    near = np.empty_like(points)
    count, held = 0, math.inf
    for i in range(points.shape[0]):
        away = length_of(points[i, 0], points[i, 1])
        if away < _FARTHEST:
            near[count, 0], near[count, 1] = points[i, 0], points[i, 1]
            count += 1
            held = min(held, away)
    near = near[:count]
    if count == 0:
        return command
    enough = min(s.body + s.margin, max(held - _SAME, s.body + _LEAST))
    best, most = command, -math.inf
    for turning in (1.0, 0.0):
        for share in _SHARES:
            tried = command[0] * share, command[1] * turning
            distance = least_distance(near, motion, tried, s.wheel_base, s.acceleration, s.step)
            if distance >= enough:
                return tried
            if distance > most:
                best, most = tried, distance
    return best


@kernel()
def least_distance(
    points: np.ndarray,
    motion: tuple[float, float],
    command: tuple[float, float],
    wheel_base: float,
    acceleration: float,
    step: float,
) -> float:
    """Least distance (m) from points to the robot's middle until it stands.

    For one control step it obeys a command and brakes from then on, both wheels at the
    acceleration that they have (m/s²).

    Args:
        points: (n, 2) in the robot's frame now (m).
        motion: Its speed (m/s) and turn rate (rad/s) now.
        command: Speed and turn rate that it is asked for.
        wheel_base: Distance between the wheels (m).
        acceleration: Greatest change of a wheel's speed in a second (m/s²).
        step: Duration of a control step (s).
    """
    half = wheel_base / 2
    left, right = motion[0] - half * motion[1], motion[0] + half * motion[1]
    goal = command[0] - half * command[1], command[0] + half * command[1]
    piece = step / _PIECES
    x = y = heading = 0.0
    least, k = np.inf, 0
    while k < _PIECES or left != 0.0 or right != 0.0:
        if k == _PIECES:
            goal = 0.0, 0.0
        left, right = _ramp(left, right, goal, acceleration * piece)
        way, turn = piece * (left + right) / 2, piece * (right - left) / wheel_base
        x += way * math.cos(heading + turn / 2)
        y += way * math.sin(heading + turn / 2)
        heading += turn
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - x, points[i, 1] - y
            least = min(least, dx * dx + dy * dy)
        k += 1
    return math.sqrt(least)


@kernel()
def _ramp(left: float, right: float, goal: tuple[float, float], most: float) -> tuple[float, float]:
    """Wheel speeds changed towards others, in proportion, by at most `most` (m/s)."""
    change = max(abs(goal[0] - left), abs(goal[1] - right))
    share = most / change if change > most else 1.0
    return left + share * (goal[0] - left), right + share * (goal[1] - right)
