"""Outward journeys: how homing robots got to where their episodes begin.

On its outward journey a robot explores, controlled by the gap explorer of
`albot_core.planning`, and so builds its map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from albot_core.errors import InputError
from albot_core.planning.gap_explorer import GapExplorer, GapExplorerConfig
from albot_core.planning.percept import Percept
from albot_core.ranges import Range, check_fields
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.episode_snapshot import EpisodeSnapshot
from albot_env.tasks.core.journeys import Journeys, JourneySpec
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.robots import BatchedRobots
from albot_env.tasks.core.settings import Equipment
from albot_maps import ROBOT_RADIUS, World
from albot_maps.geodesic import DistanceField

_LENGTH = Range("a number within [0, 100000]", 0.0, 100_000.0)


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
        check_fields(self, _LENGTH, *vars(self))
        if self.shortest > self.longest:
            expected = f"at least shortest, {self.shortest:g}"
            raise InputError("OutwardJourneyConfig.longest", expected, f"{self.longest:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class OutwardJourney:
    """A completed outward journey."""

    world: World
    """World of the journey."""
    end: EpisodeSnapshot
    """State of the robot at the end."""
    field: DistanceField
    """Geodesic distances home from everywhere."""
    cut_short: bool
    """Whether the robot got stuck before it had driven the drawn length."""


class OutwardJourneys(Journeys[OutwardJourney]):
    """Makes outward journeys, and caches them.

    Args:
        environment: Id of the environment, for error messages.
        equipment: Equipment of the robots.
        observations: Observation config of the robots, including coverage.
        config: Length of journeys.
        count: Number of different journeys per start; 0 for a new one each time.

    Raises:
        InputError: `count` is negative.
    """

    _STEPS_PER_METRE = 40
    """Step limit per metre of a journey, after which the robot counts as stuck."""
    _STEPS = 400
    """Constant part of the step limit."""

    def __init__(
        self,
        environment: str,
        equipment: Equipment,
        observations: ObservationConfig,
        config: OutwardJourneyConfig,
        count: int,
    ) -> None:
        seen = observations.coverage, observations.laser_range
        super().__init__(environment, (replace(equipment, threads=1), *seen, config), count)
        self._config = config
        # The scout always observes coverage, so that robots that do can use its journeys, too.
        parts = dict.fromkeys((*observations.parts, "coverage"))
        self._scout = BatchedRobots(
            1,
            replace(equipment, threads=1),
            actions=ActionConfig(),
            observations=replace(observations, parts=tuple(parts)),
        )
        self._explorer = GapExplorer(GapExplorerConfig(coverage_range=observations.coverage.radius))

    def close(self) -> None:
        """Stop the threads of the robot that drives the journeys."""
        self._scout.close()

    def travel(self, spec: JourneySpec) -> OutwardJourney:
        """Make a journey."""
        world, start, number = spec
        rng = np.random.default_rng((number, *start.view(np.uint64).tolist()))
        wanted = float(rng.uniform(self._config.shortest, self._config.longest))
        field = DistanceField(world.walls, ROBOT_RADIUS, start[:2])
        scout, explorer = self._scout, self._explorer
        scout.begin(0, world, start, rng)
        explorer.reset(rng)
        scout.observe()
        arrived, left = False, self._STEPS + int(self._STEPS_PER_METRE * wanted)
        while left and not arrived:
            scout.drive(explorer.command(self._percept())[np.newaxis])
            scout.observe()
            away = field.distance(scout.poses[0, :2]) >= self._config.away
            arrived, left = bool(away and scout.path_lengths[0] >= wanted), left - 1
        while not scout.at_rest:
            scout.drive(np.zeros((1, 2)))
            scout.observe()
        if math.isinf(field.distance(scout.poses[0, :2])):
            field = DistanceField(world.walls, ROBOT_RADIUS, start[:2], tight=True)
        return OutwardJourney(
            world=world, end=scout.episode_snapshot(0), field=field, cut_short=not arrived
        )

    def _percept(self) -> Percept:
        """Return the explorer's current input."""
        scout = self._scout
        return Percept(
            ranges=np.minimum(scout.ranges[0], scout.observation_config.laser_range),
            laser=scout.ground_laser,
            pose=scout.beliefs[0].copy(),
            motion=scout.readings.motions[0].copy(),
        )
