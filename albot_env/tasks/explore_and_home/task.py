"""The round trip: an expedition that explores and is to be home before its time is up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, check_fields
from albot_env.sim.simulator import CONTROL_STEP
from albot_env.tasks.core.actions import DeclaringActionConfig, Numbers
from albot_env.tasks.core.observation import ROUND_TRIP, ObservationConfig
from albot_env.tasks.core.robots import Expedition
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.way_home import Fields, HomeFields, find_way, no_fields, with_field
from albot_env.tasks.explore_and_home.reward import (
    TERMS,
    RoundTrips,
    RoundTripWeights,
    Rules,
    appraise_round_trip,
)
from albot_maps import World


@dataclass(frozen=True, kw_only=True)
class RoundTripConfig:
    """What actions ask for, how observations are scaled, what is rewarded, and the budget."""

    actions: DeclaringActionConfig = field(default_factory=DeclaringActionConfig)
    """What actions ask for."""
    observations: ObservationConfig = field(
        default_factory=lambda: ObservationConfig(parts=ROUND_TRIP)
    )
    """How observations are scaled, and which ground counts as covered."""
    weights: RoundTripWeights = field(default_factory=RoundTripWeights)
    """What the reward's terms are worth."""
    shortest: float = 120.0
    """The time that a robot has in all is drawn from this (s)…"""
    longest: float = 300.0
    """…to this, each as likely."""
    radius: float = 1.0
    """How near to where the robot set out is home (m), as the crow flies."""
    ground: float = 40.0
    """Who comes home must have covered so much ground (m²)…"""
    share: float = 0.5
    """…or this share of what can be reached, where that is less: who stays at home
    has not explored."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "shortest", "longest", "radius")
        if self.shortest > self.longest:
            expected = f"at least shortest, {self.shortest:g}"
            raise InputError("RoundTripConfig.longest", expected, f"{self.longest:g}")
        check_fields(self, NOT_NEGATIVE, "ground")
        check_fields(self, SHARE, "share")


class RoundTrip(Expedition):
    """Robots that are to explore, and to be home before their time is up.

    Args:
        robots: How many.
        equipment: What they set out with.
        config: What actions ask for, how observations are scaled, what is rewarded.
    """

    task: ClassVar[str] = "Albot/ExploreAndHome-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = TERMS
    has_budget: ClassVar[bool] = True

    def __init__(self, robots: int, equipment: Equipment, config: RoundTripConfig | None) -> None:
        config = chosen_config(config, RoundTripConfig, self.task)
        super().__init__(
            robots, equipment, actions=config.actions, observations=config.observations
        )
        self._config = config
        self._ways = HomeFields()
        self._reckoning = ArgumentsCache(self._books)
        self._fields = no_fields(robots)
        self._trips = RoundTrips(
            budgets=np.ones(robots, np.int64),
            time_left=np.zeros(robots),
            distances=np.zeros(robots),
            turns=np.zeros((robots, 2)),
            farthest=np.zeros(robots),
            driven=np.zeros(robots),
            declares=np.zeros(robots, np.bool_),
            declared=np.zeros(robots, np.bool_),
            success=np.zeros(robots, np.bool_),
            ended=np.zeros(robots, np.bool_),
            spl=np.zeros(robots),
            soft_spl=np.zeros(robots),
        )

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Let a robot set out anew with an empty map, for a time that is drawn."""
        time = rng.uniform(self._config.shortest, self._config.longest)
        super().begin(row, world, start, rng)
        self._trips.budgets[row] = max(1, round(time / CONTROL_STEP))
        self._fields = with_field(self._fields, row, self._ways.find(world, start))
        find_way(row, float(start[0]), float(start[1]), self._fields, self._trips)

    def act(self, numbers: Numbers) -> None:
        """One control step of all robots with these actions, of which some declare home."""
        self._trips.declares[:] = self._config.actions.declares(numbers)
        super().act(numbers)

    def _appraise(self, rows: Int64[np.ndarray, "some"]) -> None:
        arguments = self._reckoning.arguments(self._fields)
        appraise_round_trip(rows, arguments, CONTROL_STEP, self.observations)

    def _books(self, fields: Fields) -> tuple[Any, ...]:
        """What the appraisal takes."""
        config, weights = self._config, self._config.weights
        shown = self.observing.time_scale, self.observing.layout.time_left
        rules = Rules(config.radius, config.ground, config.share, *shown)
        return (
            weights.values,
            weights.discount,
            rules,
            self._cell_area,
            self.collided,
            fields,
            self._senses,
            self._survey.findings,
            self._standing,
            self._trips,
        )

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Who has declared home, or has no time left."""
        return self._trips.ended

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The truth in numbers, for `info`: a row for each robot."""
        trips = self._trips
        return super().facts | {
            "is_success": trips.success,
            "declared": trips.declared,
            "spl": trips.spl,
            "soft_spl": trips.soft_spl,
            "distance_home": trips.distances,
            "farthest_distance_home": trips.farthest,
            "next_turn_home": trips.turns,
            "time_left": trips.time_left,
        }
