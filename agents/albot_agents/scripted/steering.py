"""Steering: the way to a point near by that keeps clear of what the laser sees."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_agents.agent import Action
from albot_core.errors import InputError
from albot_env.tasks.action import ActionConfig
from albot_maps import ROBOT_RADIUS


@dataclass(frozen=True, kw_only=True)
class SteeringConfig:
    """How closely the robot passes things, and how fast."""

    radius: float = 0.33
    """The robot's own radius and what it keeps clear beside it (m)."""
    lookahead: float = 1.0
    """Free way wanted in a direction before it is taken (m)."""
    braking: float = 0.5
    """Deceleration that the speed leaves room for (m/s²)."""
    actions: ActionConfig = field(default_factory=ActionConfig)
    """What the environment makes of actions."""
    creep: float = 0.3
    """Speed past things that are all but touched (m/s)."""
    ease: float = 2.5
    """How much faster for each metre that the nearest thing is farther away (1/s)."""
    gain: float = 2.0
    """Turn rate asked for each radian off the direction (1/s)."""
    pivot: float = 0.7
    """Farther off the direction than this the robot turns on the spot (rad)."""

    def __post_init__(self) -> None:
        for name in ("radius", "lookahead", "braking", "creep", "ease", "gain", "pivot"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise InputError(f"SteeringConfig.{name}", "a positive number", str(value))


DIRECTIONS = np.radians(np.arange(-90.0, 91.0, 3.0))
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
    return np.asarray(np.maximum(np.where(meets, way, np.inf).min(axis=1), 0))


def steer(
    points: Float64[np.ndarray, "beams 2"],
    target: Float64[np.ndarray, "2"],
    config: SteeringConfig = SteeringConfig(),
) -> Action:
    """The action that brings the robot towards `target` without touching anything.

    Of the directions with enough free way it takes the one nearest to the target's; it
    turns on the spot where that is far off or where there is none.

    Args:
        points: Where the laser's beams end (m, robot's frame).
        target: Where to go (m, robot's frame).
        config: How closely to pass, and how fast.
    """
    distance = float(np.hypot(target[0], target[1]))
    bearing = float(np.arctan2(target[1], target[0]))
    way = free_way(points, config.radius)
    open_ways = way >= min(config.lookahead, distance)
    if abs(bearing) > np.pi / 2 or not open_ways.any():
        return _action(0.0, np.copysign(config.actions.turn_rate, bearing), config)
    off = np.where(open_ways, np.abs(DIRECTIONS - bearing), np.inf)
    direction = float(DIRECTIONS[off.argmin()])
    turn_rate = config.gain * direction
    if abs(direction) > config.pivot:
        return _action(0.0, turn_rate, config)
    ahead = float(way[len(way) // 2])
    room = min(ahead, distance + 0.2)
    nearest = float(np.hypot(points[:, 0], points[:, 1]).min())
    speed = min(
        config.actions.speed,
        float(np.sqrt(2 * config.braking * room)),
        config.creep + config.ease * max(0.0, nearest - ROBOT_RADIUS),
    )
    return _action(speed * np.cos(direction) ** 2, turn_rate, config)


def _action(speed: float, turn_rate: float, config: SteeringConfig) -> Action:
    shares = np.array((speed / config.actions.speed, turn_rate / config.actions.turn_rate))
    return np.asarray(np.clip(shares, -1, 1), np.float32)
