"""Exploration: robots that cover ground and enter rooms."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.types import Pose
from albot_core.kernels.arguments import ArgumentsCache
from albot_env.sim.simulator import CONTROL_STEP
from albot_env.sim.world_cache import WorldCache
from albot_env.tasks.core.actions import ActionConfig, Numbers
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.row_arrays import Arrays, copied_rows, put_rows
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.explore.claims import (
    KEPT_CLAIMS,
    ClaimingActionConfig,
    Claims,
    no_claims,
    with_room,
)
from albot_env.tasks.explore.reward import ExploreTerms, ExploreWeights, compute_reward
from albot_maps import World
from albot_maps.same_place import NO_BARRIERS, with_barriers


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
        mappers = self._mappers
        self._matches = mappers is not None and mappers.recognises_places
        matched = mappers.matched_readings if mappers is not None and self._matches else None
        self._claims = no_claims(robots, matched)
        self._room_left = 0
        self._worlds_barriers = WorldCache(robots, self._add_barriers, self._forget_barriers)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a new episode with an empty map for a robot; call `observe` first."""
        super().begin(row, world, start, rng)
        self._claims.claims[row] = False
        self._reserve_claims(row, world)

    def _reserve_claims(self, row: int, world: World) -> None:
        """Make room for the claims of a robot in a world."""
        self._claims = with_room(self._claims, 0, len(world.rooms))
        if self._matches:
            for other, number in self._worlds_barriers.enter(row, world):
                self._claims.worlds[other] = number

    def _task_state(self, row: int) -> Arrays:
        readings = int(self._stats.steps[row]) + 1
        claims = copied_rows("claims", self._claims, row, KEPT_CLAIMS)
        visited = copied_rows("claims", self._claims, row, ("points", "rooms", "visits"))
        return {**claims, **{name: array[:readings] for name, array in visited.items()}}

    def _set_task_state(self, row: int, world: World, arrays: Arrays) -> None:
        self._reserve_claims(row, world)
        if self._matches:
            self._claims = with_room(self._claims, len(arrays["claims.points"]) + 1, 0)
            self._room_left = 0
        put_rows("claims", self._claims, row, arrays)

    def _add_barriers(self, world: World) -> int:
        """Add the barriers between one world's places; return the world's index."""
        barriers = with_barriers(self._claims.barriers, world)
        self._claims = self._claims._replace(barriers=barriers)
        return len(barriers.spans) - 1

    def _forget_barriers(self) -> None:
        self._claims = self._claims._replace(barriers=NO_BARRIERS)

    def act(self, numbers: Numbers) -> None:
        """Run one control step of all robots with these actions, some of which may be claims."""
        if isinstance(self.actions, ClaimingActionConfig):
            self._claims.claims[:] = self.actions.declares(numbers)
        super().act(numbers)
        if self._matches:
            # A robot has no more readings than there were steps since the arrays had room.
            self._room_left -= 1
            if self._room_left < 0:
                readings = int(self._stats.steps.max()) + 1
                self._claims = with_room(self._claims, readings, 0)
                self._room_left = self._claims.points.shape[1] - readings

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        claims = self._claims
        if self._matches and claims.claims.any():
            assert self._mappers is not None
            claiming = rows[claims.claims[rows] & ~claims.judged[rows]]
            self._mappers.match_readings(claiming)
        compute_reward(rows, self._arguments.arguments(self._claims), CONTROL_STEP)

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
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        returns, right, false = self._claims.counts.T
        claims = {"re_entries": returns, "right_claims": right, "false_claims": false}
        return super().facts | claims
