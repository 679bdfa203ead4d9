"""Steering: the way to a point near by that keeps clear of what the laser sees."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.planning.steering_kernels import (
    COUNT,
    Limits,
    brake_in_time,
    find_free_way,
    steer_towards,
)
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
        check_fields(self, POSITIVE, *(field.name for field in fields(self)))

    @cached_property
    def limits(self) -> Limits:
        """The same as the compiled loops take it."""
        return Limits(*(getattr(self, name) for name in Limits._fields))


DIRECTIONS = np.linspace(-np.pi, np.pi, COUNT, endpoint=False)
"""The directions that are weighed (rad)."""


def free_way(
    points: Float64[np.ndarray, "beams 2"], radius: float
) -> Float64[np.ndarray, "directions"]:
    """How far (m) a disc can go in each of `DIRECTIONS` before it touches a point."""
    way = np.empty(COUNT)
    find_free_way(points, radius, np.inf, way)
    return way


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
    x, y = target.tolist()
    return np.array(steer_towards(points, x, y, config.limits))


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
    ahead, _, turned = motion.tolist()
    now, (speed, turn_rate) = (ahead / config.step, turned / config.step), command.tolist()
    return np.array(brake_in_time(points, now, (speed, turn_rate), config.limits))
