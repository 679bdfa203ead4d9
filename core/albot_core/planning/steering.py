"""Steering: drive towards a nearby point without touching what the laser sees.

`steer` chooses a free direction and a speed. `admissible_command` then limits the command so that
the robot can brake in time.
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
from albot_core.robot import PIONEER_3DX, RobotConfig

Command = Float64[np.ndarray, "2"]
"""Speed (m/s) and turn rate (rad/s, counter-clockwise)."""
_COUNT = 180
"""Number of directions that are considered."""
_SPACING = 2 * math.pi / _COUNT
DIRECTIONS = np.linspace(-np.pi, np.pi, _COUNT, endpoint=False)
"""The directions that are considered (rad)."""
_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the desired speed that are tried if the robot could not brake in time."""
_RANGE_TOLERANCE = 0.005
"""Decrease of an obstacle's distance (m) that is tolerated, because ranges are noisy."""
_MIN_CLEARANCE = 0.015
"""Distance (m) from the body below which no decrease is tolerated; many steps would add up to a
collision."""
_FARTHEST = 1.5
"""Distance within which the robot can stop from any speed (m)."""
_PIECES = 4
"""Number of pieces of a control step with constant speeds, in the prediction."""


@dataclass(frozen=True, kw_only=True)
class SteeringConfig:
    """Steering parameters: the robot, its clearances, speeds and braking."""

    robot: RobotConfig = PIONEER_3DX
    """Body and drive of the robot."""
    clearance: float = 0.08
    """Distance that its body keeps from obstacles (m)."""
    tight_clearance: float = 0.03
    """The same (m) if no free direction near the target's exists otherwise."""
    lookahead: float = 1.0
    """Least free distance in a chosen direction (m)."""
    braking: float = 0.5
    """Deceleration for which the speed leaves space (m/s²)."""
    speed: float = 1.0
    """Largest speed (m/s), if the robot is not slower."""
    turn_rate: float = 2.0
    """Largest turn rate (rad/s), if the robot is not slower."""
    min_speed: float = 0.3
    """Speed at an obstacle that almost touches the robot (m/s)."""
    speed_per_metre: float = 2.5
    """Increase of speed per metre of distance to the nearest obstacle (1/s)."""
    gain: float = 2.0
    """Turn rate per radian between heading and direction (1/s)."""
    turn_on_spot_angle: float = 0.7
    """Angle to the direction above which the robot turns on the spot (rad)."""
    margin: float = 0.04
    """Least distance from obstacles if the robot brakes after the command (m)."""
    step: float = 0.1
    """Duration of a control step (s)."""

    def __post_init__(self) -> None:
        names = (field.name for field in fields(self))
        check_fields(self, POSITIVE, *(name for name in names if name != "robot"))

    @property
    def radius(self) -> float:
        """Radius of the robot with its clearance (m)."""
        return self.robot.radius + self.clearance

    @cached_property
    def limits(self) -> Limits:
        """The parameters as a tuple for compiled loops."""
        robot = self.robot
        return Limits(
            radius=self.radius,
            tight_radius=robot.radius + self.tight_clearance,
            lookahead=self.lookahead,
            braking=self.braking,
            body=robot.radius,
            speed=min(self.speed, robot.max_speed),
            turn_rate=min(self.turn_rate, robot.max_turn_rate),
            min_speed=self.min_speed,
            speed_per_metre=self.speed_per_metre,
            gain=self.gain,
            turn_on_spot_angle=self.turn_on_spot_angle,
            margin=self.margin,
            acceleration=robot.acceleration,
            wheel_base=robot.wheel_base,
            step=self.step,
        )


class Limits(NamedTuple):
    """The parameters of `SteeringConfig` and of its robot."""

    radius: float
    tight_radius: float
    lookahead: float
    braking: float
    body: float
    speed: float
    turn_rate: float
    min_speed: float
    speed_per_metre: float
    gain: float
    turn_on_spot_angle: float
    margin: float
    acceleration: float
    wheel_base: float
    step: float


def steer(
    points: Float64[np.ndarray, "beams 2"],
    target: Float64[np.ndarray, "2"],
    config: SteeringConfig = SteeringConfig(),
) -> Command:
    """Return the command that drives the robot towards `target` without touching anything.

    Of the directions with enough free distance it takes the one closest to the target's. It turns
    on the spot if that direction is far from the heading, or if there is none. The points must
    surround the robot: without the corner that it has just turned away from, it would turn back.

    Args:
        points: Visible obstacles, and remembered ones behind (m, robot's frame).
        target: The target (m, robot's frame).
        config: The parameters.
    """
    x, y = target.tolist()
    return np.array(_steer_towards(points, x, y, config.limits))


@kernel(arrays=True)
def _steer_towards(points: np.ndarray, x: float, y: float, s: Limits) -> tuple[float, float]:
    """Return the command of `steer` towards the target x, y (m, robot's frame)."""
    distance, bearing = length_of(x, y), math.atan2(y, x)
    way = np.empty(_COUNT)
    direction, least = bearing, math.inf
    for radius in (s.radius, s.tight_radius):
        _find_free_distances(points, radius, _FARTHEST, way)
        for k in range(_COUNT):
            if way[k] >= min(s.lookahead, distance):
                candidate = k * _SPACING - math.pi
                off = abs(wrap_angle(candidate - bearing))
                if off < least:
                    direction, least = candidate, off
        if least <= s.turn_on_spot_angle:
            break
    if least == math.inf:
        return 0.0, math.copysign(s.turn_rate, bearing)
    turn_rate = min(max(s.gain * direction, -s.turn_rate), s.turn_rate)
    if abs(direction) > s.turn_on_spot_angle:
        return 0.0, turn_rate
    nearest = math.inf
    for i in range(points.shape[0]):
        nearest = min(nearest, length_of(points[i, 0], points[i, 1]))
    room = min(way[_COUNT // 2], distance + 0.2)
    speed = min(
        s.speed,
        math.sqrt(2 * s.braking * room),
        s.min_speed + s.speed_per_metre * max(0.0, nearest - s.body),
    )
    return speed * math.cos(direction) ** 2, turn_rate


def free_distances(
    points: Float64[np.ndarray, "beams 2"], radius: float
) -> Float64[np.ndarray, "directions"]:
    """Return the free distance (m) of a disc in each of `DIRECTIONS` until it touches a point."""
    way = np.empty(_COUNT)
    _find_free_distances(points, radius, np.inf, way)
    return way


@kernel()
def _find_free_distances(
    points: np.ndarray, radius: float, farthest: float, way: np.ndarray
) -> None:
    """Write the free distance (m) of a disc in each of `DIRECTIONS` to `way`.

    Points farther away than `farthest` (m) are ignored.
    """
    for k in range(_COUNT):
        way[k] = math.inf
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        away = math.sqrt(x * x + y * y)
        if away >= farthest:
            continue
        # A point already closer than the radius must not block motion alongside it.
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
    """Return the command, or a similar one after which the robot can brake before all obstacles.

    After the dynamic window of Fox, Burgard and Thrun (The dynamic window approach to
    collision avoidance, IEEE Robotics & Automation Magazine 4(1), 1997): commands after
    which the robot cannot brake in time are not admissible. The speed is reduced first, then the
    turn is dropped, because it bends the braking path.

    Args:
        command: The desired command.
        points: End points of the laser's beams (m, robot's frame).
        motion: The robot's motion in the last step (m, m, rad).
        config: The parameters.
    """
    ahead, _, turned = motion.tolist()
    now, (speed, turn_rate) = (ahead / config.step, turned / config.step), command.tolist()
    return np.array(_find_admissible_command(points, now, (speed, turn_rate), config.limits))


@kernel(arrays=True)
def _find_admissible_command(
    points: np.ndarray, motion: tuple[float, float], command: tuple[float, float], s: Limits
) -> tuple[float, float]:
    """Return the command of `admissible_command`; `motion` is the current speed and turn rate."""
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
    enough = min(s.body + s.margin, max(held - _RANGE_TOLERANCE, s.body + _MIN_CLEARANCE))
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
    """Return the least distance (m) from points to the robot's centre until it stands still.

    The robot executes a command for one control step, then brakes. Both wheels change speed by at
    most `acceleration`.

    Args:
        points: The points (n, 2) in the robot's current frame (m).
        motion: Current speed (m/s) and turn rate (rad/s).
        command: Commanded speed (m/s) and turn rate (rad/s).
        wheel_base: Distance between the wheels (m).
        acceleration: Largest acceleration of a wheel (m/s²).
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
    """Return wheel speeds changed proportionally towards `goal`, by at most `most` (m/s)."""
    change = max(abs(goal[0] - left), abs(goal[1] - right))
    share = most / change if change > most else 1.0
    return left + share * (goal[0] - left), right + share * (goal[1] - right)
