"""A robot driven along a tour without stopping, as in the thesis's section 3.2.4."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, wrap_angle
from albot_core.geometry.types import Points
from albot_core.sensing.reading import Reading
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_experiments.guided_tour import Journey, lead
from albot_maps.world import World

_ARRIVED = 0.15
"""A waypoint is passed when it is this near (m)."""
_STEERING = 3.0
"""Turn rate for each radian that the robot heads past the waypoint (1/s)."""
_TURN_FIRST = np.radians(45.0)
"""With a waypoint farther than this to the side the robot turns on the spot (rad)."""


@dataclass(frozen=True, kw_only=True)
class Driving:
    """How the robot is driven. The thesis's was led by the arrow keys of its laptop."""

    speed: float = 0.5
    """Speed straight on (m/s)."""
    turn_rate: float = np.radians(30.0)
    """Fastest turn (rad/s)."""

    def __post_init__(self) -> None:
        if not (self.speed > 0 and self.turn_rate > 0):
            found = f"{self.speed}, {self.turn_rate}"
            raise InputError("Driving", "a speed and a turn rate above 0", found)


def driven_tour(
    world: World,
    waypoints: Points,
    rng: np.random.Generator,
    *,
    driving: Driving = Driving(),
    odometer: OdometerConfig = ODOMETERS["pioneer"],
) -> Journey:
    """Drive a robot through the waypoints; a reading every 0.1 s.

    The guide sees where the robot truly is, so that the odometer's errors do not change the
    way.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    simulator = Simulator(world, sensors=Sensors(odometer=odometer))
    return lead(simulator, world, waypoints, rng, partial(_drive_to, simulator, driving=driving))


def _drive_to(simulator: Simulator, waypoint: Points, driving: Driving) -> Iterator[Reading]:
    """Head for the waypoint until it is reached; one reading a control step."""
    while np.hypot(*(to := waypoint - simulator.pose[:2])) > _ARRIVED:
        aside = float(wrap_angle(math.atan2(to[1], to[0]) - simulator.pose[2]))
        forwards = max(0.0, 1.0 - abs(aside) / _TURN_FIRST)
        turn_rate = np.clip(_STEERING * aside, -driving.turn_rate, driving.turn_rate)
        yield simulator.step(driving.speed * forwards, float(turn_rate))


def views_apart(journey: Journey, spacing: float, turn: float) -> Journey:
    """The journey as a log holds it that notes a view every `spacing` or `turn`.

    A view is noted once the odometer says that the robot has come so far (m), or turned so
    much (rad), since the last one noted.
    """
    readings, kept = [journey.readings[0]], [0]
    since = np.zeros(3)
    for index, reading in enumerate(journey.readings[1:], start=1):
        since = compose(since, reading.motion)
        if np.hypot(since[0], since[1]) >= spacing or abs(since[2]) >= turn:
            readings.append(replace(reading, motion=since))
            kept.append(index)
            since = np.zeros(3)
    return Journey(readings=tuple(readings), truth=journey.truth[kept])
