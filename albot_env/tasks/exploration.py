"""The exploration: an expedition to cover ground and enter rooms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from jaxtyping import Int64

from albot_core.parcel import Parcel
from albot_env.sim.simulator import CONTROL_STEP
from albot_env.tasks.action import ActionConfig
from albot_env.tasks.equipment import Equipment
from albot_env.tasks.expedition import Expedition
from albot_env.tasks.exploration_kernel import TERMS, appraise
from albot_env.tasks.observation import ObservationConfig
from albot_env.tasks.reward import ExploreWeights


@dataclass(frozen=True, kw_only=True)
class ExploreConfig:
    """What actions ask for, how observations are scaled, and what is rewarded."""

    actions: ActionConfig = field(default_factory=ActionConfig)
    """What actions ask for."""
    observations: ObservationConfig = field(default_factory=ObservationConfig)
    """How observations are scaled, and which ground counts as covered."""
    weights: ExploreWeights = field(default_factory=ExploreWeights)
    """What the reward's terms are worth."""


class Exploration(Expedition):
    """Robots that are to cover as much ground and enter as many rooms as they can.

    Args:
        robots: How many.
        equipment: What they set out with.
        config: What actions ask for, how observations are scaled, what is rewarded.
    """

    task: ClassVar[str] = "Albot/Explore-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = TERMS

    def __init__(self, robots: int, equipment: Equipment, config: ExploreConfig) -> None:
        super().__init__(
            robots, equipment, actions=config.actions, observations=config.observations
        )
        self._books = Parcel(
            (
                config.weights.values,
                self._cell_area,
                self.collided,
                self._senses,
                self._survey.findings,
                self._standing,
            )
        )

    def _appraise(self, rows: Int64[np.ndarray, "some"]) -> None:
        appraise(rows, self._books, CONTROL_STEP)
