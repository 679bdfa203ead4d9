"""Exploration: robots that cover ground and enter rooms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.types import Pose
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.robot import CONTROL_STEP
from albot_env.tasks.core.actions import ActionConfig, ClaimingActionConfig, Numbers
from albot_env.tasks.core.claims import ClaimJudge, Claims
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.explore.reward import ExploreTerms, ExploreWeights, compute_reward
from albot_maps import World


@dataclass(frozen=True, kw_only=True)
class ExploreConfig:
    """Parameters of actions, observations and rewards."""

    actions: ActionConfig = field(default_factory=ActionConfig)
    """Speed and turn rate of actions."""
    claims: bool = True
    """Whether actions have a third number, which claims that the place is known (see `claims`)."""
    observations: ObservationConfig = field(default_factory=ObservationConfig)
    """Parts and scales of observations, and the coverage grid."""
    weights: ExploreWeights = field(default_factory=ExploreWeights)
    """Weights of the reward's terms."""


class ExploreTask(DrivingTask):
    """Robots that cover as much ground and enter as many rooms as they can.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations and rewards.
    """

    environment: ClassVar[str] = "Albot/Explore-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = ExploreTerms._fields

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: ExploreConfig | None = None,
    ) -> None:
        config = chosen_config(config, ExploreConfig, self.environment)
        actions = config.actions
        if config.claims:
            actions = ClaimingActionConfig(speed=actions.speed, turn_rate=actions.turn_rate)
        super().__init__(robots, equipment, actions=actions, observations=config.observations)
        self._arguments = ArgumentsCache(self._reward_arguments)
        self._weights = config.weights.values
        self._judge = ClaimJudge(robots, self._matcher)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a new episode with an empty map for a robot; call `observe` first."""
        super().begin(row, world, start, rng)
        self._judge.begin(row, world)

    def _task_state(self, row: int) -> Arrays:
        return self._judge.state(row, int(self._stats.steps[row]))

    def _set_task_state(self, row: int, world: World, arrays: Arrays) -> None:
        self._judge.set_state(row, world, arrays)

    def act(self, numbers: Numbers) -> None:
        """Run one control step of all robots with these actions, some of which may be claims."""
        self._judge.hear(self.actions.flagged(numbers, "claim"), self._stats.steps)
        super().act(numbers)

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        compute_reward(rows, self._arguments.arguments(self._judge.table), CONTROL_STEP)

    def _reward_arguments(self, claims: Claims) -> tuple[Any, ...]:
        """Return the arguments of `compute_reward`."""
        return (
            self._weights,
            self._cell_area,
            self.collided,
            self._state,
            self._builder.progress,
            self._stats,
            claims,
        )

    @property
    def claim_outcomes(self) -> Int64[np.ndarray, "robots"]:
        """What the claim of each robot would be now, if it were the first of its visit."""
        rooms = self._builder.progress.room
        return self._judge.outcomes(self.poses, rooms, self.path_lengths)

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        return super().facts | self._judge.facts
