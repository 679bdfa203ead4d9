"""Steering: the way to a point near by that keeps clear of what the laser sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.exploration.braking_kernels import least_distance
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose
from albot_core.ranges import POSITIVE, check_fields

Command = Float64[np.ndarray, "2"]
"""Speed (m/s) and turn rate (rad/s, counter-clockwise)."""


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
        check_fields(self, POSITIVE, *vars(self))


_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the speed wanted that are tried where braking would come too late."""
_SAME = 0.005
"""Things that come nearer by no more than this (m) count as no nearer: ranges are noisy."""
_FARTHEST = 1.5
"""Within this the robot comes to a stand from any speed (m)."""
DIRECTIONS = np.radians(np.arange(-180.0, 180.0, 2.0))
"""The directions that are weighed (rad)."""


def free_way(
    points: Float64[np.ndarray, "beams 2"], radius: float
) -> Float64[np.ndarray, "directions"]:
    """How far (m) a disc can go in each of `DIRECTIONS` before it touches a point."""
    cos, sin = np.cos(DIRECTIONS)[:, None], np.sin(DIRECTIONS)[:, None]
    along = cos * points[:, 0] + sin * points[:, 1]
    aside = cos * points[:, 1] - sin * points[:, 0]
    # A point that is already nearer than the radius must not bar the way along it.
    reach = np.minimum(radius, 0.97 * np.hypot(points[:, 0], points[:, 1]))
    meets = (np.abs(aside) < reach) & (along > 0)
    way = along - np.sqrt(np.maximum(reach**2 - aside**2, 0))
    return np.asarray(np.maximum(np.where(meets, way, np.inf).min(axis=1, initial=np.inf), 0))


def steer(
    points: Float64[np.ndarray, "beams 2"],
    target: Float64[np.ndarray, "2"],
    config: SteeringConfig = SteeringConfig(),
) -> Command:
    """The command that brings the robot towards `target` without touching anything.

    Of the directions with enough free way it takes the one nearest to the target's, and
    turns on the spot where that is far off or where there is none. All round: one who
    forgot the corner that he has turned away from would turn back to it.

    Args:
        points: Things in view, and remembered ones behind (m, robot's frame).
        target: Where to go (m, robot's frame).
        config: How closely to pass, and how fast.
    """
    distance = float(np.hypot(target[0], target[1]))
    bearing = float(np.arctan2(target[1], target[0]))
    away = np.hypot(points[:, 0], points[:, 1])
    near = points[away < _FARTHEST]
    for radius in (config.radius, config.tight):
        way = free_way(near, radius)
        open_ways = way >= min(config.lookahead, distance)
        off = np.where(open_ways, np.abs(wrap_angle(DIRECTIONS - bearing)), np.inf)
        if off.min() <= config.pivot:
            break
    if not open_ways.any():
        return _command(0.0, np.copysign(config.turn_rate, bearing), config)
    direction = float(DIRECTIONS[off.argmin()])
    turn_rate = config.gain * direction
    if abs(direction) > config.pivot:
        return _command(0.0, turn_rate, config)
    ahead = float(way[len(way) // 2])
    room = min(ahead, distance + 0.2)
    speed = min(
        config.speed,
        float(np.sqrt(2 * config.braking * room)),
        config.creep + config.ease * max(0.0, float(away.min()) - config.body),
    )
    return _command(speed * np.cos(direction) ** 2, turn_rate, config)


def hold_back(
    command: Command,
    points: Float64[np.ndarray, "beams 2"],
    motion: Pose,
    config: SteeringConfig = SteeringConfig(),
) -> Command:
    """The command, or one near it after which the robot can still stop before all it sees.

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
    near = points[np.hypot(points[:, 0], points[:, 1]) < _FARTHEST]
    if not len(near):
        return command
    now = motion[0] / config.step, motion[2] / config.step
    held = float(np.hypot(near[:, 0], near[:, 1]).min()) - _SAME
    enough = min(config.body + config.margin, held)
    best, most = command, -np.inf
    for turning in (1.0, 0.0):
        for share in _SHARES:
            tried = np.asarray(command * (share, turning))
            speed, turn_rate = tried.tolist()
            distance = least_distance(
                near, now, (speed, turn_rate), config.wheel_base, config.acceleration, config.step
            )
            if distance >= enough:
                return tried
            if distance > most:
                best, most = tried, distance
    return best


def _command(speed: float, turn_rate: float, config: SteeringConfig) -> Command:
    limits = np.array((config.speed, config.turn_rate))
    return np.asarray(np.clip((speed, turn_rate), -limits, limits))
