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
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.planning.leading import LED, Driving
from albot_core.sensing.reading import Reading
from albot_env.sim.compass import CompassConfig
from albot_env.sim.laser import LMS_200, LaserConfig
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.scenes import SceneConfig
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import THESIS_STEPS, Simulator, StartStop, follow_leg
from albot_env.sim.sonar import SonarConfig
from albot_maps.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class TourRecord:
    """A robot's readings on a journey, and its true poses."""

    readings: tuple[Reading, ...]
    """The readings, one for each view."""
    truth: Poses
    """(views, 3): the true pose at every reading, in the world frame."""

    @property
    def path_length(self) -> float:
        """The length of the path from view to view (m)."""
        return float(np.hypot(*np.diff(self.truth[:, :2], axis=0).T).sum())

    def nearest_view(self, place: Points) -> int:
        """Return the view that was taken nearest to a point of the world (m)."""
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
    compass: CompassConfig | None = None,
) -> TourRecord:
    """Guide a robot, with sonars and compass if given, through the waypoints; return the journey.

    The guide knows the robot's true pose, so the odometer's errors do not change the path. Every
    leg begins with a turn towards its end; the turn and the way are cut into equal steps.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    sensors = Sensors(laser=laser, odometer=odometer, sonar=sonar, compass=compass)
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
    """Lead a simulated robot through the waypoints; return the journey.

    Args:
        simulator: The robot, in `world`.
        world: The world.
        waypoints: The waypoints (m); the robot begins at the first, facing the second.
        rng: Generator of the sensors' errors.
        go_to: Moves the robot to a waypoint and yields its readings.

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
    """Return the pose at the first waypoint, facing the second."""
    first = waypoints[1] - waypoints[0]
    return np.array([*waypoints[0], math.atan2(first[1], first[0])])


def true_motions(journey: TourRecord) -> Poses:
    """Return the true motion to every view from the previous one, (views, 3); the first is 0."""
    before = np.concatenate((journey.truth[:1], journey.truth[:-1]))
    return relative(before, journey.truth)


def driven_tour(
    world: World,
    waypoints: Points,
    rng: np.random.Generator,
    *,
    driving: Driving = LED,
    odometer: OdometerConfig = ODOMETERS["pioneer"],
    sonar: SonarConfig | None = None,
    scenes: SceneConfig | None = None,
) -> TourRecord:
    """Drive a robot through the waypoints, with a reading every 0.1 s; return the journey.

    The robot has sonars and scenes if any are given. The guide knows the robot's true pose, so the
    odometer's errors do not change the path.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    simulator = Simulator(world, sensors=Sensors(odometer=odometer, sonar=sonar, scenes=scenes))
    return lead(simulator, world, waypoints, rng, partial(drive_to, simulator, driving=driving))


def drive_to(simulator: Simulator, waypoint: Points, driving: Driving) -> Iterator[Reading]:
    """Drive to the waypoint; yield one reading for each control step."""
    while (command := driving.command_towards(waypoint, simulator.pose)) is not None:
        yield simulator.step(*command.tolist())


def thinned_views(journey: TourRecord, spacing: float, turn: float) -> TourRecord:
    """Return the journey with only one view every `spacing` or `turn`.

    A view is kept once the odometer reports that the robot has moved this far (m), or turned this
    much (rad), since the last kept view.
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
