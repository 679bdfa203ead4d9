"""Exploring and coming home: robots that explore and return home before their time is up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, check_fields
from albot_core.robot import CONTROL_STEP
from albot_env.tasks.core.actions import (
    ActionConfig,
    DeclaringActionConfig,
    MissionActionConfig,
    Numbers,
)
from albot_env.tasks.core.claims import ClaimJudge, Claims
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig, chosen_observations
from albot_env.tasks.core.row_arrays import Arrays, copied_rows, put_rows
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.way_home import (
    DistanceFieldCache,
    DistanceFields,
    FieldCopies,
    empty_fields,
    update_way_home,
    with_field,
    with_field_rows,
)
from albot_env.tasks.explore_and_home.reward import (
    ExploreAndHomeTerms,
    ExploreAndHomeWeights,
    Rules,
    compute_reward,
    new_explore_and_home_stats,
)
from albot_maps import World
from albot_maps.geodesic import DistanceField


@dataclass(frozen=True, kw_only=True)
class ExploreAndHomeConfig:
    """Parameters of actions, observations, rewards and the time budget."""

    actions: DeclaringActionConfig = field(default_factory=DeclaringActionConfig)
    """Speed and turn rate of actions, and the declaration."""
    claims: bool = True
    """Whether actions have a fourth number, which claims that the place is known (see `claims`)."""
    observations: ObservationConfig | None = None
    """Parts and scales of observations; None for `parts_by_map`, all that the mapper can give, and
    the time left."""
    hints: bool = False
    """Whether what a planner has worked out may be observed (`HINTS`)."""
    weights: ExploreAndHomeWeights = field(default_factory=ExploreAndHomeWeights)
    """Weights of the reward's terms."""
    shortest: float = 120.0
    """Minimum time budget, which is drawn uniformly (s)."""
    longest: float = 300.0
    """Maximum time budget (s)."""
    radius: float = 1.0
    """Straight-line distance from the start within which the robot is home (m)."""
    ground: float = 40.0
    """Ground that must be covered for success (m²)."""
    share: float = 0.5
    """Share of the reachable ground that suffices if it is less than `ground`. Without these
    conditions, staying at home would be a success."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "shortest", "longest", "radius")
        if self.shortest > self.longest:
            expected = f"at least shortest, {self.shortest:g}"
            raise InputError("ExploreAndHomeConfig.longest", expected, f"{self.longest:g}")
        check_fields(self, NOT_NEGATIVE, "ground")
        check_fields(self, SHARE, "share")


class ExploreAndHomeTask(DrivingTask):
    """Robots that explore and return home before their time is up.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards and the time budget.

    Raises:
        InputError: The mapper is unknown, or hints are to be observed though `config.hints` is
            false.
    """

    environment: ClassVar[str] = "Albot/ExploreAndHome-v1"
    terms_of_reward: ClassVar[tuple[str, ...]] = ExploreAndHomeTerms._fields
    has_budget: ClassVar[bool] = True

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: ExploreAndHomeConfig | None = None,
    ) -> None:
        config = chosen_config(config, ExploreAndHomeConfig, self.environment)
        seen = chosen_observations(config, equipment.spec, "time_left")
        actions: ActionConfig = config.actions
        if config.claims:
            actions = MissionActionConfig(**vars(config.actions))
        super().__init__(robots, equipment, actions=actions, observations=seen)
        self._config = config
        self._distance_fields = DistanceFieldCache()
        self._arguments = ArgumentsCache(self._reward_arguments)
        self._judge = ClaimJudge(robots, self._matcher)
        self._fields = empty_fields(robots)
        self._field_copies = FieldCopies(robots)
        self._trips = new_explore_and_home_stats(robots)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a new episode with an empty map and a random time budget for a robot."""
        time = rng.uniform(self._config.shortest, self._config.longest)
        super().begin(row, world, start, rng)
        self._judge.begin(row, world)
        self._trips.budgets[row] = max(1, round(time / CONTROL_STEP))
        self._fields = with_field(
            self._fields, row, self._distance_fields.find(world, self.home_of(world, start))
        )
        update_way_home(row, float(start[0]), float(start[1]), self._fields, self._trips)

    def most_steps(self, row: int) -> int:
        """Return the time budget."""
        return int(self._trips.budgets[row])

    def _on_strike(self, row: int, way: Segments | None) -> None:
        if way is not None:
            field = DistanceField(way, self.world(row).robot_radius, self.starts[row, :2])
            self._fields = with_field(self._fields, row, field)
        x, y, _ = self.poses[row].tolist()
        update_way_home(row, x, y, self._fields, self._trips)

    def _task_state(self, row: int) -> Arrays:
        return {
            **self._judge.state(row, int(self._stats.steps[row])),
            **copied_rows("trips", self._trips, row),
            **self._field_copies.of(self._fields, row),
        }

    def _set_task_state(self, row: int, world: World, arrays: Arrays) -> None:
        self._judge.set_state(row, world, arrays)
        put_rows("trips", self._trips, row, arrays)
        self._fields = with_field_rows(self._fields, row, arrays)

    def act(self, numbers: Numbers) -> None:
        """Run one control step of all robots; some actions may declare home, or claim."""
        self._trips.declares[:] = self.actions.flagged(numbers, "declare")
        self._judge.hear(self.actions.flagged(numbers, "claim"), self._stats.steps)
        super().act(numbers)

    def _observe(self, rows: Int64[np.ndarray, "some"], thread: int) -> None:
        steps_left = self._trips.budgets[rows] - self._stats.steps[rows]
        self._state.time_left[rows] = steps_left * CONTROL_STEP
        super()._observe(rows, thread)

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        arguments = self._arguments.arguments(self._fields, self._judge.table)
        compute_reward(rows, arguments, CONTROL_STEP)

    def _reward_arguments(self, fields: DistanceFields, claims: Claims) -> tuple[Any, ...]:
        """Return the arguments of `compute_reward`."""
        config, weights = self._config, self._config.weights
        rules = Rules(config.radius, config.ground, config.share)
        return (
            weights.values,
            rules,
            self._cell_area,
            self.collided,
            fields,
            self._state,
            self._builder.progress,
            self._stats,
            self._trips,
            claims,
        )

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots have declared home or have no time left."""
        return self._trips.ended

    @property
    def claim_outcomes(self) -> Int64[np.ndarray, "robots"]:
        """What the claim of each robot would be now, if it were the first of its visit."""
        rooms = self._builder.progress.room
        return self._judge.outcomes(self.poses, rooms, self.path_lengths)

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        trips = self._trips
        return (
            super().facts
            | (self._judge.facts if self._config.claims else {})
            | {
                "is_success": trips.success,
                "declared": trips.declared,
                "spl": trips.spl,
                "soft_spl": trips.soft_spl,
                "distance_home": trips.distances,
                "farthest_distance_home": trips.farthest,
                "next_turn_home": trips.turns,
                "time_left": self._state.time_left,
            }
        )
