"""Outward journeys: how homing robots got to where their episodes begin.

On an outward journey a robot builds its map. A guide decides where it drives: in most tasks the gap
explorer of `albot_core.planning`, which knows the true pose and sees the true ranges of a laser of
its own. So the way is a function of the world, the start and the journey's number alone. A robot
then drives the same way, command by command, with its own sensors and mapper.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse
from albot_core.geometry.types import Points, Pose
from albot_core.mappers.registry import NO_MAPPER
from albot_core.planning.gap_explorer import GapExplorer, GapExplorerConfig
from albot_core.planning.percept import Percept
from albot_core.planning.steering import SteeringConfig
from albot_core.ranges import Range, check_fields
from albot_env.sim.sensors import Sensors
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.claims import ClaimJudge, judge_claim
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.episode_snapshot import EpisodeSnapshot
from albot_env.tasks.core.journeys import JourneyCache, Journeys, JourneySpec
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.core.settings import Equipment
from albot_maps import World
from albot_maps.geodesic import DistanceField

LENGTHS = Range("a number within [0, 100000]", 0.0, 100_000.0)
"""Lengths that journeys may have (m)."""


@dataclass(frozen=True, kw_only=True)
class OutwardJourneyConfig:
    """Length of outward journeys, of 100 km at most."""

    shortest: float = 30.0
    """Minimum length of a journey, which is drawn uniformly (m)."""
    longest: float = 100.0
    """Maximum length of a journey (m)."""
    away: float = 5.0
    """A journey is extended while the way home from its end is shorter than this (m)."""

    def __post_init__(self) -> None:
        check_fields(self, LENGTHS, *vars(self))
        if self.shortest > self.longest:
            expected = f"at least shortest, {self.shortest:g}"
            raise InputError("OutwardJourneyConfig.longest", expected, f"{self.longest:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class OutwardJourney:
    """A completed outward journey."""

    world: World
    """World of the journey."""
    number: int
    """Its number among those from its start."""
    end: EpisodeSnapshot
    """State of the robot at the end."""
    visited: Arrays
    """Where it has been: see `ClaimJudge.visited`."""
    readings: int
    """Number of readings that it has taken."""
    path: Points
    """Its true positions (world frame, m)."""
    field: DistanceField
    """Geodesic distances home from everywhere."""
    cut_short: bool
    """Whether the robot got stuck before it had driven the drawn length."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Route:
    """The way of an outward journey."""

    world: World
    """World of the journey."""
    commands: Float64[np.ndarray, "steps 2"]
    """Speed (m/s) and turn rate (rad/s) of each control step; at rest after the last."""
    field: DistanceField
    """Geodesic distances home from everywhere."""
    cut_short: bool
    """Whether the robot got stuck before it had driven the drawn length."""


class Guide(ABC):
    """Decides where a robot drives on its outward journey.

    Args:
        equipment: Equipment of the robots; of it, only body and obstacles matter.
    """

    kind: Any
    """What its ways depend on besides their specs, hashable."""

    def __init__(self, equipment: Equipment) -> None:
        robot, movables = equipment.robot, equipment.movables
        self._robot = DrivingTask(
            1,
            Equipment(mapper=NO_MAPPER, robot=robot, sensors=Sensors(), movables=movables),
            actions=ActionConfig(),
            observations=ObservationConfig(parts=("motion",)),
        )

    def close(self) -> None:
        """Stop the threads."""
        self._robot.close()

    @abstractmethod
    def find_route(self, spec: JourneySpec) -> Route:
        """Return the way of a journey, which depends on nothing but `spec` and `kind`."""

    def _begin(self, spec: JourneySpec) -> list[Float64[np.ndarray, "2"]]:
        """Put the robot at the start; return the empty list of its commands."""
        self._robot.begin(0, spec.world, spec.start, journey_noise(spec))
        self._robot.observe()
        return []

    def _drive(
        self, command: Float64[np.ndarray, "2"], commands: list[Float64[np.ndarray, "2"]]
    ) -> None:
        """Make one control step with a speed (m/s) and a turn rate (rad/s)."""
        commands.append(command)
        self._robot.drive(command[np.newaxis])
        self._robot.observe()

    def _stop(self, commands: list[Float64[np.ndarray, "2"]]) -> None:
        """Brake until the robot is at rest."""
        while not self._robot.at_rest:
            self._drive(np.zeros(2), commands)


_ROUTES = JourneyCache(limit=32 * 2**20)
"""The latest ways: agents that are compared drive them one after another."""


class OutwardJourneys(Journeys[OutwardJourney]):
    """Makes outward journeys, and caches them.

    Args:
        environment: Id of the environment, for error messages.
        equipment: Equipment of the robots.
        observations: Observation config of the robots, including coverage.
        guide: Decides where robots drive.
        count: Number of different journeys per start; 0 for a new one each time.

    Raises:
        InputError: `count` is negative.
    """

    def __init__(
        self,
        environment: str,
        equipment: Equipment,
        observations: ObservationConfig,
        guide: Guide,
        count: int,
    ) -> None:
        # The state at the end holds what was covered and the trail, and no other part of an
        # observation.
        seen = observations.coverage, observations.map_patch.trail
        # Nothing goes wrong before an episode begins.
        equipment = replace(equipment, threads=1, faults=())
        super().__init__(environment, (equipment, *seen, guide.kind), count)
        self._guide = guide
        # It always observes coverage and leaves a trail, so that robots that do can use its
        # journeys, too. The smallest patch that leaves one is drawn without the mapper's map.
        others = (part for part in observations.parts if part != "place_graph")
        parts = dict.fromkeys((*others, "coverage", "map_patch"))
        patch = replace(observations.map_patch, sides=(1.0,), cells=2, channels=("home",))
        self._follower = _Follower(
            1,
            equipment,
            actions=ActionConfig(),
            observations=replace(observations, parts=tuple(parts), map_patch=patch),
        )

    def close(self) -> None:
        """Stop the threads of the robots that drive the journeys."""
        self._guide.close()
        self._follower.close()

    def travel(self, spec: JourneySpec) -> OutwardJourney:
        """Make a journey: find the way, and let a robot with the equipment drive it."""
        key = (self._guide.kind, id(spec.world), spec.start.tobytes(), spec.number)
        route = _ROUTES.fetch(key, lambda: self._guide.find_route(spec))
        follower = self._follower
        follower.begin(0, spec.world, spec.start, journey_noise(spec))
        follower.observe()
        path = [follower.poses[0, :2].copy()]
        for command in route.commands:
            follower.follow(command)
            path.append(follower.poses[0, :2].copy())
        readings = len(route.commands) + 1
        return OutwardJourney(
            world=spec.world,
            number=spec.number,
            end=follower.episode_snapshot(0),
            visited=follower.judge.visited(0, readings),
            readings=readings,
            path=np.array(path),
            field=route.field,
            cut_short=route.cut_short,
        )


class _Follower(DrivingTask):
    """A robot that drives a given way, and of which is remembered where it has been."""

    def __init__(self, robots: int, equipment: Equipment, **configs: Any) -> None:
        super().__init__(robots, equipment, **configs)
        self.judge = ClaimJudge(robots, self._matcher)
        """What it has visited; it claims nothing."""

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start with an empty map; call `observe` before anything else."""
        super().begin(row, world, start, rng)
        self.judge.begin(row, world)

    def follow(self, command: Float64[np.ndarray, "2"]) -> None:
        """Make one control step with a speed (m/s) and a turn rate (rad/s), and observe."""
        self.judge.hear(self._never, self._stats.steps)
        self.drive(command[np.newaxis])
        self.observe()

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        super()._compute_rewards(rows)
        progress, stats = self._builder.progress, self._stats
        for row in rows.tolist():
            judge_claim(
                row,
                int(stats.steps[row]),
                float(stats.path_lengths[row]),
                self._state.poses[row],
                int(progress.room[row]),
                bool(progress.new_room[row]),
                self.judge.table,
            )


class ExploringGuide(Guide):
    """Lets the gap explorer decide, until it has driven far enough.

    Args:
        equipment: Equipment of the robots; of it, only body and obstacles matter.
        config: Length of journeys.
    """

    _STEPS_PER_METRE = 40
    """Step limit per metre of a journey, after which the robot counts as stuck."""
    _STEPS = 400
    """Constant part of the step limit."""

    def __init__(self, equipment: Equipment, config: OutwardJourneyConfig) -> None:
        super().__init__(equipment)
        self._config = config
        self.kind = config, equipment.robot, equipment.movables
        self._explorer = GapExplorer(
            GapExplorerConfig(steering=SteeringConfig(robot=equipment.robot))
        )

    def find_route(self, spec: JourneySpec) -> Route:
        """Return the way of a journey, which depends on nothing but `spec` and `kind`."""
        world, start = spec.world, spec.start
        rng = np.random.default_rng(_seed(spec))
        wanted = float(rng.uniform(self._config.shortest, self._config.longest))
        field = DistanceField(world.walls, world.robot_radius, start[:2])
        robot, explorer = self._robot, self._explorer
        commands = self._begin(spec)
        explorer.reset(rng)
        before = start
        arrived, left = False, self._STEPS + int(self._STEPS_PER_METRE * wanted)
        while left and not arrived:
            percept = self._percept(before)
            before = robot.poses[0].copy()
            self._drive(explorer.command(percept), commands)
            away = field.distance(robot.poses[0, :2]) >= self._config.away
            arrived, left = bool(away and robot.path_lengths[0] >= wanted), left - 1
        self._stop(commands)
        if math.isinf(field.distance(robot.poses[0, :2])):
            field = DistanceField(world.walls, world.robot_radius, start[:2], tight=True)
        return Route(
            world=world,
            commands=np.array(commands).reshape(-1, 2),
            field=field,
            cut_short=not arrived,
        )

    def _percept(self, before: Pose) -> Percept:
        """Return the explorer's input: the truth, in the frame of the start.

        Args:
            before: True pose one control step ago (world frame).
        """
        robot, laser = self._robot, self._robot.ground_laser
        pose = robot.poses[0]
        return Percept(
            ranges=np.minimum(robot.true_ranges[0], laser.max_range),
            laser=laser,
            pose=compose(inverse(robot.starts[0]), pose),
            motion=compose(inverse(before), pose),
        )


def _seed(spec: JourneySpec) -> tuple[int, ...]:
    """Return the seed of a journey's random numbers."""
    return spec.number, *spec.start.view(np.uint64).tolist()


def journey_noise(spec: JourneySpec) -> np.random.Generator:
    """Return the generator of a journey's noise, the same for the guide and who follows it.

    So both meet doors, boxes and people at the same places.
    """
    return np.random.default_rng((*_seed(spec), 1))
