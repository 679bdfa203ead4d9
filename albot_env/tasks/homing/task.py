"""Homing: robots that are to find home again, and to say so."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.kernels.arguments import ArgumentsCache
from albot_env.sim.batch_simulator import draw_key
from albot_env.sim.simulator import CONTROL_STEP
from albot_env.tasks.core.actions import DeclaringActionConfig, Numbers
from albot_env.tasks.core.observation import HOMING_PARTS, ObservationConfig
from albot_env.tasks.core.robots import BatchedRobots
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.way_home import DistanceFields, empty_fields, update_way_home, with_field
from albot_env.tasks.homing.outward_journey import (
    OutwardJourneyConfig,
    OutwardJourneys,
)
from albot_env.tasks.homing.reward import (
    HomingTerms,
    HomingWeights,
    compute_reward,
    new_homing_stats,
)
from albot_maps import World


@dataclass(frozen=True, kw_only=True)
class HomingConfig:
    """What actions ask for, how observations are scaled, what is rewarded, and the way out."""

    actions: DeclaringActionConfig = field(default_factory=DeclaringActionConfig)
    """What actions ask for."""
    observations: ObservationConfig = field(
        default_factory=lambda: ObservationConfig(parts=HOMING_PARTS)
    )
    """How observations are scaled, and which ground counts as covered."""
    weights: HomingWeights = field(default_factory=HomingWeights)
    """What the reward's terms are worth."""
    outing: OutwardJourneyConfig = field(default_factory=OutwardJourneyConfig)
    """How long outward journeys are."""
    radius: float = 1.0
    """How near to where the robot set out is home (m), as the crow flies."""

    def __post_init__(self) -> None:
        if not 0 < self.radius < np.inf:
            raise InputError("HomingConfig.radius", "a positive length (m)", str(self.radius))


class HomingTask(BatchedRobots):
    """Robots that have explored and are to drive home.

    Args:
        robots: How many.
        equipment: What they set out with.
        config: What actions ask for, how observations are scaled, what is rewarded.
        journeys: How many outward journeys there are from a start; 0 for a new one each time.

    Raises:
        InputError: The number of journeys is negative, or there is no such mapper.
    """

    environment: ClassVar[str] = "Albot/Homing-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = HomingTerms._fields

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: HomingConfig | None = None,
        journeys: int = 0,
    ) -> None:
        config = chosen_config(config, HomingConfig, self.environment)
        super().__init__(
            robots, equipment, actions=config.actions, observations=config.observations
        )
        self._config = config
        self._arguments = ArgumentsCache(self._reward_arguments)
        self.journeys = self._outward_journeys = OutwardJourneys(
            self.environment, equipment, config.observations, config.outing, journeys
        )
        self._shared = journeys > 0
        self._outward_lengths = np.zeros(robots)
        self._cut_short = np.zeros(robots, np.bool_)
        self._fields = empty_fields(robots)
        self._homing = new_homing_stats(robots)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Let a robot begin at the end of an outward journey, with what it has seen on it."""
        journey = self._outward_journeys.draw(world, start, rng)
        # Those who share a journey share no noise afterwards.
        self.restore(row, world, journey.end, draw_key(rng) if self._shared else None)
        self.begin_return(row)
        self._outward_lengths[row] = journey.end.path_length
        self._cut_short[row] = journey.cut_short
        self._fields = with_field(self._fields, row, journey.field)
        x, y, _ = journey.end.body.pose.tolist()
        update_way_home(row, x, y, self._fields, self._homing)

    def act(self, numbers: Numbers) -> None:
        """One control step of all robots with these actions, of which some declare home."""
        self._homing.declares[:] = self._config.actions.declares(numbers)
        super().act(numbers)

    def close(self) -> None:
        """Stop the threads."""
        super().close()
        self._outward_journeys.close()

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        compute_reward(rows, self._arguments.arguments(self._fields), CONTROL_STEP)

    def _reward_arguments(self, fields: DistanceFields) -> tuple[Any, ...]:
        """The arguments of `compute_reward`."""
        return (
            self._config.weights.values,
            self._config.weights.discount,
            self._config.radius,
            self._cell_area,
            self.collided,
            fields,
            self._state,
            self._builder.progress,
            self._stats,
            self._homing,
        )

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots have declared home."""
        return self._homing.declared

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The truth in numbers, for `info`: a row for each robot."""
        homing = self._homing
        return super().facts | {
            "is_success": homing.success,
            "declared": homing.declared,
            "spl": homing.spl,
            "soft_spl": homing.soft_spl,
            "distance_home": homing.distances,
            "initial_distance_home": homing.initial,
            "next_turn_home": homing.turns,
            "way_driven": homing.driven,
            "outward_length": self._outward_lengths,
            "outward_cut_short": self._cut_short,
        }
