"""The homecoming: an expedition that is to find home again, and to say so."""

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
from albot_env.tasks.core.observation import HOMEWARD, ObservationConfig
from albot_env.tasks.core.robots import Expedition
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.way_home import Fields, find_way, no_fields, with_field
from albot_env.tasks.homing.outward_journey import Outing, OutingConfig, Outings
from albot_env.tasks.homing.reward import TERMS, Homecoming, HomingWeights, appraise_homing
from albot_maps import World


@dataclass(frozen=True, kw_only=True)
class HomingConfig:
    """What actions ask for, how observations are scaled, what is rewarded, and the way out."""

    actions: DeclaringActionConfig = field(default_factory=DeclaringActionConfig)
    """What actions ask for."""
    observations: ObservationConfig = field(
        default_factory=lambda: ObservationConfig(parts=HOMEWARD)
    )
    """How observations are scaled, and which ground counts as covered."""
    weights: HomingWeights = field(default_factory=HomingWeights)
    """What the reward's terms are worth."""
    outing: OutingConfig = field(default_factory=OutingConfig)
    """How long outward journeys are."""
    radius: float = 1.0
    """How near to where the robot set out is home (m), as the crow flies."""

    def __post_init__(self) -> None:
        if not 0 < self.radius < np.inf:
            raise InputError("HomingConfig.radius", "a positive length (m)", str(self.radius))


class Homing(Expedition):
    """Robots that have explored and are to drive home.

    Args:
        robots: How many.
        equipment: What they set out with.
        config: What actions ask for, how observations are scaled, what is rewarded.
        journeys: How many outward journeys there are from a start; 0 for a new one each time.

    Raises:
        InputError: There are fewer journeys than none, or there is no such mapper.
    """

    task: ClassVar[str] = "Albot/Homing-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = TERMS

    def __init__(
        self, robots: int, equipment: Equipment, config: HomingConfig | None, journeys: int
    ) -> None:
        config = chosen_config(config, HomingConfig, self.task)
        super().__init__(
            robots, equipment, actions=config.actions, observations=config.observations
        )
        self._config = config
        self._reckoning = ArgumentsCache(self._books)
        self.journeys = self._outings = Outings(
            self.task, equipment, config.observations, config.outing, journeys
        )
        self._shared = journeys > 0
        self._outward = np.zeros(robots)
        self._cut_short = np.zeros(robots, np.bool_)
        self._fields = no_fields(robots)
        self._homecoming = Homecoming(
            distances=np.zeros(robots),
            initial=np.zeros(robots),
            aversions=np.zeros(robots),
            driven=np.zeros(robots),
            turns=np.zeros((robots, 2)),
            declares=np.zeros(robots, np.bool_),
            declared=np.zeros(robots, np.bool_),
            success=np.zeros(robots, np.bool_),
            spl=np.zeros(robots),
            soft_spl=np.zeros(robots),
        )

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Let a robot begin at the end of an outward journey, with what it has seen on it."""
        outing = self._outings.draw(world, start, rng)
        # Those who share a journey share no noise afterwards.
        self.resume(row, world, outing.rest, draw_key(rng) if self._shared else None)
        self._outward[row] = outing.rest.path_length
        self._cut_short[row] = outing.cut_short
        self._show_home(row, outing)

    def _show_home(self, row: int, outing: Outing) -> None:
        """Lay a robot's field of ways home."""
        self._fields = with_field(self._fields, row, outing.field)
        x, y, _ = outing.rest.halt.pose.tolist()
        find_way(row, x, y, self._fields, self._homecoming)

    def act(self, numbers: Numbers) -> None:
        """One control step of all robots with these actions, of which some declare home."""
        self._homecoming.declares[:] = self._config.actions.declares(numbers)
        super().act(numbers)

    def close(self) -> None:
        """Let the threads go."""
        super().close()
        self._outings.close()

    def _appraise(self, rows: Int64[np.ndarray, "some"]) -> None:
        appraise_homing(rows, self._reckoning.arguments(self._fields), CONTROL_STEP)

    def _books(self, fields: Fields) -> tuple[Any, ...]:
        """What the appraisal takes."""
        return (
            self._config.weights.values,
            self._config.weights.discount,
            self._config.radius,
            self._cell_area,
            self.collided,
            fields,
            self._senses,
            self._survey.findings,
            self._standing,
            self._homecoming,
        )

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Who has declared home."""
        return self._homecoming.declared

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The truth in numbers, for `info`: a row for each robot."""
        home = self._homecoming
        return super().facts | {
            "is_success": home.success,
            "declared": home.declared,
            "spl": home.spl,
            "soft_spl": home.soft_spl,
            "distance_home": home.distances,
            "initial_distance_home": home.initial,
            "next_turn_home": home.turns,
            "way_driven": home.driven,
            "outward_length": self._outward,
            "outward_cut_short": self._cut_short,
        }
