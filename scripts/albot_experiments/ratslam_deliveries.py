"""RatSLAM delivers in an office, by its experience map alone (Hossain 2014, section 2.3.2)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.mappers.mapper import POINT, TRAVEL
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.mappers.registry import make_mapper
from albot_core.planning.navigator import Navigator
from albot_core.planning.percept import Percept
from albot_core.planning.route_explorer import RouteExplorer
from albot_core.planning.steering import Command
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_experiments.drawing import MARK, PATH, SURFACE, draw_floor
from albot_experiments.report import Figures, Report, each_seed
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "ratslam-deliveries"
TITLE = "RatSLAM delivers in an office (Wyeth and Milford 2009, in Hossain 2014, section 2.3.2)"
OFFICE = "random:office:{seed}?rooms=10"
EXPLORED = 15 * 60
"""The robot explores for this long (s), as in section 6 of Milford et al. 2005."""
DELIVERIES, COMPARED = 55, 10
"""Number of deliveries for each seed, and of those that are repeated by each other method."""
LIMIT = 120.0
"""A delivery fails after this time (s)."""
BOUND = 0.5
"""The robot must stand within this distance of where it truly was when it learned the goal (m)."""
ARRIVED = 0.3
"""The robot stops where it believes to be this near to the goal (m)."""
LEAST = 0.99
"""Share of the deliveries that must succeed. It was chosen on seeds 500 to 504, on which all did,
before the seeds of the report were run."""
REACH = 3.0
"""Distance of the farthest point for which the avoidance of obstacles plans (m)."""
APART = 3.0
"""Least distance between one goal and the next in the map (m)."""
PAPER = {"deliveries": 1089, "succeeded": 1088, "share": round(1088 / 1089, 4)}
OTHERS = ("pose without routes", "odometry", "random wandering")
"""The other methods."""
BEATEN = ("odometry", "random wandering")
"""Those whose share must be lower."""
Cause = Literal["wrong place", "no way", "lost", "held up"]
"""Why a delivery failed: the robot stopped elsewhere; or the time was up, and the map had no way;
or the robot took itself to be in an experience that it had made over `ELSEWHERE` away; or else."""
CAUSES: tuple[Cause, ...] = "wrong place", "no way", "lost", "held up"
ELSEWHERE = 2.0
"""See `Cause` (m)."""
CONDITIONS = {
    "environment": ("a real office building", "simulated random offices, with furniture"),
    "duration": ("32 h in eight days", "15 min of exploration an office, then its deliveries"),
    "sensors": ("a panoramic camera and wheel encoders", "a laser of 180°, odometer `pioneer`"),
    "obstacles": ("by the robot's own low-level routines", "by its laser, for each method alike"),
    "goals": ("six locations", "experiences drawn at random"),
    "limit": ("5 min; typically 1 to 3 min", f"{LIMIT:g} s; typically a quarter of a minute"),
    "exploration": (
        "one that attempts to learn all the possible routes (Milford et al. 2005)",
        "`RouteExplorer`: each route seen, in narrow places in both directions",
    ),
    "trials": ("1,089 deliveries", f"{DELIVERIES} a seed"),
}
_STEP = 0.1
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
        laser = self.reading.required_laser(ID)
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


def explore(robot: Robot, seed: int, seconds: float = EXPLORED) -> None:
    """Let a robot take all the routes that it sees, for some time."""
    explorer = RouteExplorer()
    explorer.reset(np.random.default_rng(seed))
    for _ in range(round(seconds / _STEP)):
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
            raise InputError(ID, f"experiences {APART:g} m apart", f"a map of {len(poses)}")
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
    while (steps := len(robot.truth) - begun) < LIMIT / _STEP:
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
    return Delivery(time=steps * _STEP, away=away, cause=_cause(robot, guide(robot, goal), away))


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
    while (steps := len(robot.truth) - begun) < round(seconds / _STEP):
        here = relative(start, robot.odometry[-1])
        ahead = transform_points(inverse(here), aim)
        left -= 1
        if left <= 0 or np.hypot(*ahead) < ARRIVED:
            aim, left = here[:2] + rng.uniform(-_WANDER, _WANDER, 2), round(_HOLD / _STEP)
            ahead = transform_points(inverse(here), aim)
        robot.step(driver.command(robot.percept(here), ahead))
        if robot.away_from(goal) <= BOUND:
            return Delivery(time=steps * _STEP, away=robot.away_from(goal), cause=None)
    return Delivery(time=seconds, away=robot.away_from(goal), cause="held up")


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """A robot's deliveries in one office, and those of the other methods to the first goals."""

    world: World
    robot: Robot
    explored: int
    """Number of readings of the exploration."""
    deliveries: Sequence[Delivery]
    others: Mapping[str, Sequence[Delivery]]
    both_ways: float
    """Share of the transitions at the end of the exploration that were driven in both directions"""


def new_mapper() -> RatSlam:
    """Return a mapper that has just been reset."""
    mapper = make_mapper("ratslam")
    assert isinstance(mapper, RatSlam)
    mapper.reset(np.random.default_rng(0))
    return mapper


def run_office(
    seed: int,
    *,
    office: str = OFFICE,
    seconds: float = EXPLORED,
    deliveries: int = DELIVERIES,
    compared: int = COMPARED,
) -> Trial:
    """Explore an office and deliver in it; then repeat some deliveries by the other methods.

    Each method begins with the same exploration, to the bit; random wandering goes on where the
    robot without a map has come by its odometer.
    """
    world, rng = load_world(office.format(seed=seed)), np.random.default_rng((1, seed))
    robot = Robot(world, seed, new_mapper())
    explore(robot, seed, seconds)
    explored, learned = len(robot.truth), robot.mapper.state()
    edges = robot.mapper.snapshot().place_graph.edges
    both_ways = float(np.mean([edge.reverse is not None for edge in edges]))
    goals = draw_goals(robot.mapper, deliveries, rng)
    done = [deliver(robot, goal, by_routes, rng) for goal in goals]
    known = _replayed(world, seed, robot.commands[: explored - 1])
    known.take(new_mapper())
    known.mapper.restore(learned)
    blind = _replayed(world, seed, robot.commands[: explored - 1])
    others = {
        "pose without routes": [deliver(known, goal, by_pose, rng) for goal in goals[:compared]],
        "odometry": [deliver(blind, goal, by_odometry, rng) for goal in goals[:compared]],
        "random wandering": [
            wander(blind, goal, by_map.time, rng)
            for goal, by_map in zip(goals[:compared], done, strict=False)
        ],
    }
    return Trial(
        world=world,
        robot=robot,
        explored=explored,
        deliveries=done,
        others=others,
        both_ways=both_ways,
    )


def _replayed(world: World, seed: int, commands: Sequence[Command]) -> Robot:
    """Return a robot without a mapper that has executed the commands."""
    robot = Robot(world, seed, None)
    for command in commands:
        robot.step(command)
    return robot


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Explore and deliver in one office for each seed.

    Raises:
        InputError: No seeds.
    """
    return report(seeds, [run_office(seed) for seed in each_seed(seeds, progress)])


def figures(deliveries: Sequence[Delivery]) -> dict[str, Figures]:
    """Return the measured figures of some deliveries."""
    succeeded = [each for each in deliveries if each.cause is None]
    low, high = wilson(len(succeeded), len(deliveries))
    times = [each.time for each in succeeded]
    causes = Counter(each.cause for each in deliveries)
    return {
        "deliveries": len(deliveries),
        "succeeded": len(succeeded),
        "share": round(len(succeeded) / len(deliveries), 4),
        "low": round(low, 4),
        "high": round(high, 4),
        "median_time_s": round(float(np.median(times)), 1) if times else None,
        "longest_time_s": round(max(times), 1) if times else None,
        **{cause.replace(" ", "_"): causes[cause] for cause in CAUSES},
    }


def report(seeds: range, trials: Sequence[Trial]) -> Report:
    """Return the report of the trials."""
    done = [each for trial in trials for each in trial.deliveries]
    ours = figures(done)
    others = {
        name: figures([each for trial in trials for each in trial.others[name]]) for name in OTHERS
    }
    holds = is_reached(ours, others)
    seconds = sum(len(trial.robot.truth) for trial in trials) * _STEP
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={
            **{name: ours[name] for name in PAPER},
            "seeds": len(seeds),
            "hours": round(seconds / 3600, 1),
            "median_away_m": round(float(np.median([each.away for each in done])), 2),
            "experiences": int(np.median([t.robot.mapper.experiences.count for t in trials])),
            "driven_both_ways": round(float(np.median([trial.both_ways for trial in trials])), 2),
            "seed_of_most_failures": seeds[int(np.argmax([_failures(trial) for trial in trials]))],
            "routes": ours,
            **others,
        },
        holds=holds,
        verdicts={"ratslam": holds},
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"deliveries": _picture(trials[0])},
    )


def is_reached(ours: Mapping[str, Figures], others: Mapping[str, Mapping[str, Figures]]) -> bool:
    """Return whether enough deliveries succeeded, and more than those by the methods of `BEATEN`.

    Args:
        ours: The figures of the deliveries by routes.
        others: The figures of the other methods, by name.
    """
    share, low = float(str(ours["share"])), float(str(ours["low"]))
    return share >= LEAST and all(float(str(others[name]["high"])) < low for name in BEATEN)


def _failures(trial: Trial) -> int:
    return sum(each.cause is not None for each in trial.deliveries)


def _text(seeds: range) -> str:
    return f"""
In one random office of ten furnished rooms for each of the seeds {seeds.start} to
{seeds.stop - 1}, a robot explores for {EXPLORED // 60} minutes by `RouteExplorer`, which takes each
route that it sees, in narrow places in both directions. Then it makes {DELIVERIES} deliveries. The
goal of each is an experience drawn at random, at least {APART:g} m from the goal before. Again and
again the robot recalls the quickest route to it, by the times of the transitions, and drives to a
point 2 m ahead on it. It avoids obstacles by what its laser has seen since the delivery began, and
plans for {REACH:g} m at most; if the map has no way, it stands still. It goes on mapping all the
time, as in the paper.

It stops where it believes to be within {ARRIVED:g} m of the goal. A delivery succeeds if the robot
then stands within {BOUND:g} m of where it truly was when it made that experience, and if that takes
{LIMIT:g} s at most (the paper's limit is five minutes, for deliveries of one to three). The robot
never uses a true pose. Failures are counted by cause: it stopped at a `wrong_place`; or the time
was up, and the map had `no_way`, or the robot was `lost` (in an experience that was made over
{ELSEWHERE:g} m away), or it was `held_up`.

The first {COMPARED} deliveries of each seed are repeated after the same exploration by other
methods with the same avoidance of obstacles. `pose without routes` heads straight for where the map
has the goal. `odometry` heads straight for where the odometer was at that experience. `random
wandering` drives to points drawn at random for as long as the delivery took, and succeeds if it
comes by the goal at any time.

The result is reached if at least {LEAST:.0%} of the deliveries succeed and if the interval of that
share (Wilson, 95 %: `low` to `high`) lies above those of {" and ".join(f"`{n}`" for n in BEATEN)}.
This was decided on seeds 500 to 504.

The picture shows the first seed: the way of the exploration, and the ways of the deliveries with
their goals.
"""


def _picture(trial: Trial) -> Figure:
    """Draw the ways of the exploration and of the deliveries."""
    from matplotlib.figure import Figure

    way = np.array(trial.robot.truth)[:, :2]
    figure = Figure(figsize=(12.0, 4.5), layout="constrained")
    titles = "exploration", "deliveries"
    parts = way[: trial.explored], way[trial.explored - 1 :]
    for axes, title, part in zip(figure.subplots(1, 2), titles, parts, strict=True):
        draw_floor(axes, trial.world.walls, SURFACE)
        axes.plot(part[:, 0], part[:, 1], color=PATH, lw=0.6)
        axes.plot(*part[0], "o", color=MARK, ms=5)
        axes.set_title(title)
    return figure
