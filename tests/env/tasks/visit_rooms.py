"""The task "visit rooms": enter a number of rooms as soon as possible.

The guide "add a task" in docs/tasks.md is this file, told step by step.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from jaxtyping import Bool, Int64

from albot_core.ranges import FROM_ONE, check_fields
from albot_core.robot import CONTROL_STEP
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.reward import Weights
from albot_env.tasks.core.row_arrays import Arrays
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_maps import World


class VisitRoomsTerms(NamedTuple):
    """The terms of the reward, in order."""

    room: float
    time: float


@dataclass(frozen=True, kw_only=True)
class VisitRoomsWeights(Weights):
    """Weights of the terms. The reward is their sum."""

    terms: ClassVar[Any] = VisitRoomsTerms

    room: float = 1.0
    """For every room truly entered for the first time."""
    time: float = -0.01
    """For every second that passes (1/s)."""


@dataclass(frozen=True, kw_only=True)
class VisitRoomsConfig:
    """Parameters of actions, observations, rewards and success."""

    actions: ActionConfig = field(default_factory=ActionConfig)
    """Speed and turn rate of actions."""
    observations: ObservationConfig = field(default_factory=ObservationConfig)
    """Parts and scales of observations."""
    weights: VisitRoomsWeights = field(default_factory=VisitRoomsWeights)
    """Weights of the reward's terms."""
    rooms: int = 3
    """Number of rooms to enter."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "rooms")


def is_success(rooms_entered: Int64[np.ndarray, "some"], wanted: int) -> Bool[np.ndarray, "some"]:
    """Return which robots have entered enough rooms."""
    return rooms_entered >= wanted


class VisitRoomsTask(DrivingTask):
    """Robots that enter a number of rooms as soon as they can.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards and success.
    """

    environment: ClassVar[str] = "Mine/VisitRooms-v0"
    terms_of_reward: ClassVar[tuple[str, ...]] = VisitRoomsTerms._fields

    def __init__(
        self, robots: int, equipment: Equipment, *, config: VisitRoomsConfig | None = None
    ) -> None:
        config = chosen_config(config, VisitRoomsConfig, self.environment)
        super().__init__(
            robots, equipment, actions=config.actions, observations=config.observations
        )
        self._config = config
        self._success = np.zeros(robots, np.bool_)

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        super()._compute_rewards(rows)
        stats, progress, weights = self._stats, self._builder.progress, self._config.weights
        has_moved = stats.steps[rows] > 0
        stats.terms[rows, 0] = weights.room * (progress.new_room[rows] & has_moved)
        stats.terms[rows, 1] = weights.time * CONTROL_STEP * has_moved
        stats.rewards[rows] = stats.terms[rows].sum(axis=1)
        self._success[rows] = is_success(progress.rooms_entered[rows], self._config.rooms)

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots have entered enough rooms."""
        return self._success

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        return super().facts | {"is_success": self._success}

    def _task_state(self, row: int) -> Arrays:
        return {"success": np.array(self._success[row])}

    def _set_task_state(self, row: int, world: World, arrays: Arrays) -> None:
        self._success[row] = arrays["success"]


class VisitRoomsEnv(SingleEnv[VisitRoomsTask]):
    """A robot enters a number of rooms as soon as it can.

    Action space, observation space and starting state are those of `Albot/Explore-v0`, without
    claims. The reward is the sum of the terms of `VisitRoomsWeights`. Terminated, with success,
    once `VisitRoomsConfig.rooms` rooms are entered.
    """

    task = VisitRoomsTask


class VisitRoomsVectorEnv(VectorEnv[VisitRoomsTask]):
    """Robots that enter rooms, each as in its own `VisitRoomsEnv`."""

    task = VisitRoomsTask


gymnasium.register(
    id=VisitRoomsTask.environment,
    entry_point=f"{__name__}:VisitRoomsEnv",
    vector_entry_point=f"{__name__}:VisitRoomsVectorEnv",
    max_episode_steps=3000,
)
