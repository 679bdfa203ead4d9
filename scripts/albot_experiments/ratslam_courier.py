"""A robot that delivers: to goals in its experience map, by routes, or by less.

What a robot does depends on its readings alone; its true poses are for the judge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.mappers.mapper import POINT, TRAVEL
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.planning.navigator import Navigator
from albot_core.planning.percept import Percept
from albot_core.planning.route_explorer import RouteExplorer
from albot_core.planning.steering import Command
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_maps import World

LIMIT = 120.0
"""A delivery fails after this time (s)."""
BOUND = 0.5
"""The robot must stand within this distance of where it truly was when it learned the goal (m)."""
ARRIVED = 0.3
"""The robot stops where it believes to be this near to the goal (m)."""
REACH = 3.0
"""Distance of the farthest point for which the avoidance of obstacles plans (m)."""
APART = 3.0
"""Least distance between one goal and the next in the map (m)."""
Cause = Literal["wrong place", "no way", "lost", "held up"]
"""Why a delivery failed: the robot stopped elsewhere; or the time was up, and the map had no way;
or the robot took itself to be in an experience that it had made over `ELSEWHERE` away; or else."""
CAUSES: tuple[Cause, ...] = "wrong place", "no way", "lost", "held up"
ELSEWHERE = 2.0
"""See `Cause` (m)."""
STEP = 0.1
"""Duration of a control step (s)."""
_WANDER, _HOLD = 5.0, 10.0
"""A wandering robot heads for a point drawn within this distance (m), for so long at most (s)."""


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """The outcome of a delivery."""

    time: float
    """Its duration (s)."""
    away: float
    """True distance of the robot from the goal at its end (m)."""
    cause: Cause | None
    """Why it failed; None if it did not."""


class Robot:
    """A simulated robot, with or without a mapper, and what it has sensed.

    Args:
        world: The office.
        seed: Seed of its sensors' errors.
        mapper: Its mapper; None for none.
    """

    def __init__(self, world: World, seed: int, mapper: RatSlam | None) -> None:
        sensors = Sensors(odometer=ODOMETERS["pioneer"])
        self._simulator, self._mapper = Simulator(world, sensors=sensors), mapper
        self.reading = self._simulator.reset(np.random.default_rng(seed))
        self.commands: list[Command] = []
        self.odometry = [np.zeros(3)]
        """Its pose by the odometer alone, at each reading."""
        self.truth = [self._simulator.pose]
        """Its true pose at each reading, for the judge alone."""
        if mapper is not None:
            mapper.update(self.reading)

    @property
    def mapper(self) -> RatSlam:
        """Its mapper."""
        assert self._mapper is not None, "a robot without a map"
        return self._mapper

    @property
    def has_map(self) -> bool:
        """Whether it has a mapper."""
        return self._mapper is not None

    def take(self, mapper: RatSlam) -> None:
        """Go on with another mapper."""
        self._mapper = mapper

    def step(self, command: Command) -> None:
        """Drive for one step, and map what is sensed then."""
        self.reading = self._simulator.step(*command.tolist())
        self.commands.append(command)
        self.odometry.append(compose(self.odometry[-1], self.reading.motion))
        self.truth.append(self._simulator.pose)
        if self._mapper is not None:
            self._mapper.update(self.reading)

    def percept(self, pose: Pose) -> Percept:
        """Return its latest reading as a percept at a believed pose."""
        laser = self.reading.required_laser("a courier")
        ranges = np.minimum(laser.ranges, laser.geometry.max_range)
        return Percept(ranges=ranges, laser=laser.geometry, pose=pose, motion=self.reading.motion)

    def away_from(self, goal: Goal) -> float:
        """Return its true distance from a goal (m)."""
        return math.dist(self.truth[-1][:2], self.truth[goal.reading][:2])


class Goal(NamedTuple):
    """A goal of a delivery: an experience of the map, as it was at the end of the exploration."""

    experience: int
    reading: int
    """The reading at which it was made."""


class Heading(NamedTuple):
    """Where a robot heads, by its own belief."""

    ahead: Points | None
    """The point to drive to next (m, robot's frame); None to stand still."""
    left: float
    """Distance of the goal on a straight line (m)."""


def by_routes(robot: Robot, goal: Goal) -> Heading:
    """Recall the quickest route over the experience map, and head for a point ahead on it."""
    mapper, place = robot.mapper, robot.mapper.experiences.poses[goal.experience, :2]
    way = mapper.way_to(place)
    straight = by_pose(robot, goal)
    if not math.isfinite(way[TRAVEL]):
        return Heading(None, straight.left)
    if np.isnan(way[POINT]).any():  # The goal is nearer than the point ahead would be.
        return straight
    return Heading(transform_points(inverse(mapper.estimate.pose), way[POINT]), straight.left)


def by_pose(robot: Robot, goal: Goal) -> Heading:
    """Head straight for where the map has the goal."""
    place = robot.mapper.experiences.poses[goal.experience, :2]
    ahead = transform_points(inverse(robot.mapper.estimate.pose), place)
    return Heading(ahead, float(np.hypot(*ahead)))


def by_odometry(robot: Robot, goal: Goal) -> Heading:
    """Head straight for where the odometer was when the goal was learned."""
    place = robot.odometry[goal.reading][:2]
    ahead = transform_points(inverse(robot.odometry[-1]), place)
    return Heading(ahead, float(np.hypot(*ahead)))


def explore(robot: Robot, seed: int, seconds: float) -> None:
    """Let a robot take all the routes that it sees, for some time."""
    explorer = RouteExplorer()
    explorer.reset(np.random.default_rng(seed))
    for _ in range(round(seconds / STEP)):
        robot.step(explorer.command(robot.percept(robot.mapper.estimate.pose)))


def draw_goals(mapper: RatSlam, count: int, rng: np.random.Generator) -> list[Goal]:
    """Draw experiences of a map, each at least `APART` from the one before in the map.

    Raises:
        InputError: The map is smaller than that.
    """
    experiences, here = mapper.experiences, mapper.estimate.pose[:2]
    poses, readings = experiences.poses[:, :2].copy(), experiences.experiences.rows("reading")
    goals: list[Goal] = []
    for _ in range(count):
        far = np.flatnonzero(np.hypot(*(poses - here).T) >= APART)
        if not len(far):
            raise InputError("goals", f"experiences {APART:g} m apart", f"a map of {len(poses)}")
        chosen = int(rng.choice(far))
        goals.append(Goal(chosen, int(readings[chosen])))
        here = poses[chosen]
    return goals


def deliver(
    robot: Robot, goal: Goal, guide: Callable[[Robot, Goal], Heading], rng: np.random.Generator
) -> Delivery:
    """Drive to a goal, until the robot believes to be there or the time is up.

    It avoids what its laser has seen since the delivery began, and plans no farther than `REACH`:
    the same with every guide.
    """
    driver, begun = Navigator(), len(robot.truth)
    driver.reset(rng)
    start = robot.odometry[-1]
    while (steps := len(robot.truth) - begun) < LIMIT / STEP:
        heading = guide(robot, goal)
        if heading.left < ARRIVED:
            break
        command = np.zeros(2)
        if heading.ahead is not None:
            here = relative(start, robot.odometry[-1])
            # Avoidance is local: of a farther point it is told no more than the direction.
            nearer = REACH / max(float(np.hypot(*heading.ahead)), REACH)
            command = driver.command(robot.percept(here), nearer * heading.ahead)
        robot.step(command)
    away = robot.away_from(goal)
    return Delivery(time=steps * STEP, away=away, cause=_cause(robot, guide(robot, goal), away))


def _cause(robot: Robot, heading: Heading, away: float) -> Cause | None:
    """Return why a delivery failed that ended so far away from its goal (m), if it did."""
    if heading.left < ARRIVED:
        return None if away <= BOUND else "wrong place"
    if heading.ahead is None:
        return "no way"
    if robot.has_map:
        made = robot.mapper.experiences.experiences["reading"][robot.mapper.estimate.place]
        if math.dist(robot.truth[made][:2], robot.truth[-1][:2]) > ELSEWHERE:
            return "lost"
    return "held up"


def wander(robot: Robot, goal: Goal, seconds: float, rng: np.random.Generator) -> Delivery:
    """Drive to random points for some time, or until the robot is at the goal, whether it knows."""
    driver, begun = Navigator(), len(robot.truth)
    driver.reset(rng)
    start, aim, left = robot.odometry[-1], np.zeros(2), 0
    while (steps := len(robot.truth) - begun) < round(seconds / STEP):
        here = relative(start, robot.odometry[-1])
        ahead = transform_points(inverse(here), aim)
        left -= 1
        if left <= 0 or np.hypot(*ahead) < ARRIVED:
            aim, left = here[:2] + rng.uniform(-_WANDER, _WANDER, 2), round(_HOLD / STEP)
            ahead = transform_points(inverse(here), aim)
        robot.step(driver.command(robot.percept(here), ahead))
        if robot.away_from(goal) <= BOUND:
            return Delivery(time=steps * STEP, away=robot.away_from(goal), cause=None)
    return Delivery(time=seconds, away=robot.away_from(goal), cause="held up")
