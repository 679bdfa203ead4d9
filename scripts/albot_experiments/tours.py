"""A robot led along a tour: guided in start-stop motion, or driven without stopping.

The thesis's robot is guided in most experiments, and driven in section 3.2.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, wrap_angle
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.ranges import POSITIVE, check_fields
from albot_core.sensing.reading import Reading
from albot_env.sim.laser import LMS_200, LaserConfig
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.scenes import SceneConfig
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import THESIS_STEPS, Simulator, StartStop, follow_leg
from albot_env.sim.sonar import SonarConfig
from albot_maps.world import World

_ARRIVED = 0.15
"""A waypoint is passed when it is this near (m)."""
_STEERING = 3.0
"""Turn rate for each radian that the robot heads past the waypoint (1/s)."""
_TURN_FIRST = np.radians(45.0)
"""With a waypoint farther than this to the side the robot turns on the spot (rad)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TourRecord:
    """What a robot sensed on a journey, and where it truly was."""

    readings: tuple[Reading, ...]
    """One reading a view."""
    truth: Poses
    """(views, 3): the true pose at every reading, in the world frame."""

    @property
    def path_length(self) -> float:
        """Length of the way from view to view (m)."""
        return float(np.hypot(*np.diff(self.truth[:, :2], axis=0).T).sum())

    def nearest_view(self, place: Points) -> int:
        """Which view was taken nearest to a place of the world (m)."""
        return int(np.hypot(*(self.truth[:, :2] - place).T).argmin())


def guided_tour(
    world: World,
    waypoints: Points,
    rng: np.random.Generator,
    *,
    steps: StartStop = THESIS_STEPS,
    laser: LaserConfig = LMS_200,
    odometer: OdometerConfig = ODOMETERS["pioneer"],
    sonar: SonarConfig | None = None,
) -> TourRecord:
    """Guide a robot, with sonars if any are given, through the waypoints; return what it saw.

    The guide sees where the robot truly is, so that the odometer's errors do not change the
    way. Every leg begins with a turn towards its end, and both are cut into equal steps.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    sensors = Sensors(laser=laser, odometer=odometer, sonar=sonar)
    simulator = Simulator(world, sensors=sensors)
    go_to = partial(follow_leg, simulator, steps=steps)
    return lead(simulator, world, waypoints, rng, go_to)


def lead(
    simulator: Simulator,
    world: World,
    waypoints: Points,
    rng: np.random.Generator,
    go_to: Callable[[Points], Iterable[Reading]],
) -> TourRecord:
    """Lead a simulated robot through the waypoints and return what it saw.

    Args:
        simulator: The robot, in `world`.
        world: The world.
        waypoints: Where it is led; it sets out from the first, facing the second (m).
        rng: Where its sensors' errors come from.
        go_to: Takes it to a waypoint, a reading at a time.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    readings = [simulator.reset(rng, first_pose(waypoints))]
    truth = [simulator.pose]
    for leg, waypoint in enumerate(waypoints[1:], start=1):
        for reading in go_to(waypoint):
            readings.append(reading)
            truth.append(simulator.pose)
            if simulator.collided:
                raise InputError(world.name, "a tour clear of walls", "a wall", place=f"leg {leg}")
    return TourRecord(readings=tuple(readings), truth=np.array(truth))


def first_pose(waypoints: Points) -> Pose:
    """At the first waypoint, facing the second."""
    first = waypoints[1] - waypoints[0]
    return np.array([*waypoints[0], math.atan2(first[1], first[0])])


def true_motions(journey: TourRecord) -> Poses:
    """(views, 3): the true pose at every view seen from the one before; the first is 0."""
    before = np.concatenate((journey.truth[:1], journey.truth[:-1]))
    return relative(before, journey.truth)


@dataclass(frozen=True, kw_only=True)
class Driving:
    """How the robot is driven. The thesis's was led by the arrow keys of its laptop."""

    speed: float = 0.5
    """Speed straight on (m/s)."""
    turn_rate: float = np.radians(30.0)
    """Fastest turn (rad/s)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "speed", "turn_rate")


def driven_tour(
    world: World,
    waypoints: Points,
    rng: np.random.Generator,
    *,
    driving: Driving = Driving(),
    odometer: OdometerConfig = ODOMETERS["pioneer"],
    sonar: SonarConfig | None = None,
    scenes: SceneConfig | None = None,
) -> TourRecord:
    """Drive a robot through the waypoints; a reading every 0.1 s.

    It has sonars and scenes if any are given.

    The guide sees where the robot truly is, so that the odometer's errors do not change the
    way.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    simulator = Simulator(world, sensors=Sensors(odometer=odometer, sonar=sonar, scenes=scenes))
    return lead(simulator, world, waypoints, rng, partial(_drive_to, simulator, driving=driving))


def _drive_to(simulator: Simulator, waypoint: Points, driving: Driving) -> Iterator[Reading]:
    """Head for the waypoint until it is reached; one reading a control step."""
    while np.hypot(*(to := waypoint - simulator.pose[:2])) > _ARRIVED:
        aside = float(wrap_angle(math.atan2(to[1], to[0]) - simulator.pose[2]))
        forwards = max(0.0, 1.0 - abs(aside) / _TURN_FIRST)
        turn_rate = np.clip(_STEERING * aside, -driving.turn_rate, driving.turn_rate)
        yield simulator.step(driving.speed * forwards, float(turn_rate))


def thinned_views(journey: TourRecord, spacing: float, turn: float) -> TourRecord:
    """The journey as a log that holds a view every `spacing` or `turn`.

    A view is kept once the odometer says that the robot has moved so far (m), or turned so much
    (rad), since the last one kept.
    """
    readings, kept = [journey.readings[0]], [0]
    since = np.zeros(3)
    for index, reading in enumerate(journey.readings[1:], start=1):
        since = compose(since, reading.motion)
        if np.hypot(since[0], since[1]) >= spacing or abs(since[2]) >= turn:
            readings.append(replace(reading, motion=since))
            kept.append(index)
            since = np.zeros(3)
    return TourRecord(readings=tuple(readings), truth=journey.truth[kept])
