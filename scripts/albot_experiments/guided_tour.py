"""A robot guided along a tour in start-stop motion, as in the thesis's experiments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.sensing.reading import Reading
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import THESIS_STEPS, Simulator, StartStop, follow_leg
from albot_maps.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class Journey:
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
    odometer: OdometerConfig = ODOMETERS["pioneer"],
) -> Journey:
    """Guide a robot through the waypoints and return what it saw.

    The guide sees where the robot truly is, so that the odometer's errors do not change the
    way. Every leg begins with a turn towards its end, and both are cut into equal steps.

    Raises:
        InputError: The robot bumped into something: the tour is not clear of walls.
    """
    simulator = Simulator(world, sensors=Sensors(odometer=odometer))
    go_to = partial(follow_leg, simulator, steps=steps)
    return lead(simulator, world, waypoints, rng, go_to)


def lead(
    simulator: Simulator,
    world: World,
    waypoints: Points,
    rng: np.random.Generator,
    go_to: Callable[[Points], Iterable[Reading]],
) -> Journey:
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
    return Journey(readings=tuple(readings), truth=np.array(truth))


def first_pose(waypoints: Points) -> Pose:
    """At the first waypoint, facing the second."""
    first = waypoints[1] - waypoints[0]
    return np.array([*waypoints[0], math.atan2(first[1], first[0])])


def true_motions(journey: Journey) -> Poses:
    """(views, 3): the true pose at every view seen from the one before; the first is 0."""
    before = np.concatenate((journey.truth[:1], journey.truth[:-1]))
    return relative(before, journey.truth)
