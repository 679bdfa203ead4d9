"""Homing: robots that find their way home and declare it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Int64

from albot_core.geometry.types import Points, Pose, Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.ranges import POSITIVE, check_fields
from albot_core.robot import CONTROL_STEP
from albot_env.sim.batch_simulator import draw_key
from albot_env.tasks.core.actions import (
    ActionConfig,
    DeclaringActionConfig,
    MissionActionConfig,
    Numbers,
)
from albot_env.tasks.core.claims import ClaimJudge, Claims
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import HOMING_PARTS, ObservationConfig
from albot_env.tasks.core.row_arrays import Arrays, copied_rows, put_rows
from albot_env.tasks.core.settings import Equipment, chosen_config
from albot_env.tasks.core.way_home import (
    DistanceFields,
    FieldCopies,
    empty_fields,
    update_way_home,
    with_field,
    with_field_rows,
)
from albot_env.tasks.homing.outward_journey import (
    ExploringGuide,
    Guide,
    OutwardJourney,
    OutwardJourneyConfig,
    OutwardJourneys,
)
from albot_env.tasks.homing.reward import (
    HomingTerms,
    HomingWeights,
    aversion,
    compute_reward,
    new_homing_stats,
)
from albot_maps import World
from albot_maps.geodesic import DistanceField


@dataclass(frozen=True, kw_only=True)
class WayHomeConfig:
    """Parameters of actions, observations, rewards and success on a way home."""

    actions: DeclaringActionConfig = field(default_factory=DeclaringActionConfig)
    """Speed and turn rate of actions, and the declaration."""
    claims: bool = False
    """Whether actions have a fourth number, which claims that the place is known (see `claims`)."""
    observations: ObservationConfig = field(
        default_factory=lambda: ObservationConfig(parts=HOMING_PARTS)
    )
    """Parts and scales of observations, and the coverage grid."""
    weights: HomingWeights = field(default_factory=HomingWeights)
    """Weights of the reward's terms."""
    radius: float = 1.0
    """Straight-line distance from the start within which the robot is home (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "radius")


@dataclass(frozen=True, kw_only=True)
class HomingConfig(WayHomeConfig):
    """Parameters of actions, observations, rewards and outward journeys."""

    outing: OutwardJourneyConfig = field(default_factory=OutwardJourneyConfig)
    """Length of outward journeys."""


class WayHomeTask(DrivingTask):
    """Robots at the end of an outward journey that drive home.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards and success.
        guide: Decides where robots drive on their outward journeys.
        journeys: Number of outward journeys per start; 0 for a new one each time.

    Raises:
        InputError: `journeys` is negative, or the mapper is unknown.
    """

    terms_of_reward: ClassVar[tuple[str, ...]] = HomingTerms._fields
    starts_at_home: ClassVar[bool] = True

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: WayHomeConfig,
        guide: Guide,
        journeys: int,
    ) -> None:
        actions: ActionConfig = config.actions
        if config.claims:
            actions = MissionActionConfig(**vars(config.actions))
        super().__init__(robots, equipment, actions=actions, observations=config.observations)
        self._config = config
        self._arguments = ArgumentsCache(self._reward_arguments)
        self._judge = ClaimJudge(robots, self._matcher)
        self.journeys = self._outward_journeys = OutwardJourneys(
            self.environment, equipment, config.observations, guide, journeys
        )
        self._shared = journeys > 0
        self._outward_lengths = np.zeros(robots)
        self._ways_out: list[Points] = [np.empty((0, 2))] * robots
        self._cut_short = np.zeros(robots, np.bool_)
        self._fields = empty_fields(robots)
        self._field_copies = FieldCopies(robots)
        self._homing = new_homing_stats(robots)

    def begin(self, row: int, world: World, start: Pose, rng: np.random.Generator) -> None:
        """Start a robot's episode in the state at the end of an outward journey."""
        journey = self._outward_journeys.draw(world, start, rng)
        # Robots that share a journey must not share the noise after it.
        self._set_out_from(row, journey, draw_key(rng) if self._shared else None)

    def _set_out_from(self, row: int, journey: OutwardJourney, key: int | None) -> None:
        """Start a robot's episode at the end of a journey; `key` is the seed of its noise.

        None lets it go on as if it had never stopped.
        """
        self.restore(row, journey.world, journey.end, key)
        self.begin_return(row)
        self._judge.begin_after(row, journey.world, journey.visited, journey.readings)
        self._outward_lengths[row] = journey.end.path_length
        self._ways_out[row] = journey.path
        self._cut_short[row] = journey.cut_short
        self._fields = with_field(self._fields, row, journey.field)
        x, y, _ = journey.end.body.pose.tolist()
        update_way_home(row, x, y, self._fields, self._homing)

    def _on_strike(self, row: int, way: Segments | None) -> None:
        if way is not None:
            field = DistanceField(way, self.world(row).robot_radius, self.starts[row, :2])
            self._fields = with_field(self._fields, row, field)
        pose = self.poses[row]
        update_way_home(row, pose[0], pose[1], self._fields, self._homing)
        # Nothing is paid for how the robot faces where it was put, as for where that is.
        self._homing.aversions[row] = aversion(pose, self._homing.turns[row])

    def _task_state(self, row: int) -> Arrays:
        return {
            **self._judge.state(row, int(self._stats.steps[row])),
            **copied_rows("homing", self._homing, row),
            **self._field_copies.of(self._fields, row),
            "outward.length": np.array(self._outward_lengths[row]),
            "outward.cut_short": np.array(self._cut_short[row]),
        }

    def _set_task_state(self, row: int, world: World, arrays: Arrays) -> None:
        self._judge.set_state(row, world, arrays)
        put_rows("homing", self._homing, row, arrays)
        self._fields = with_field_rows(self._fields, row, arrays)
        self._outward_lengths[row] = arrays["outward.length"]
        self._ways_out[row] = np.empty((0, 2))  # Only pictures show it.
        self._cut_short[row] = arrays["outward.cut_short"]

    def way_out(self, row: int) -> Points:
        """Return a robot's outward journey."""
        return self._ways_out[row]

    def act(self, numbers: Numbers) -> None:
        """Run one control step of all robots; some actions may declare home, or claim."""
        self._homing.declares[:] = self.actions.flagged(numbers, "declare")
        self._judge.hear(self.actions.flagged(numbers, "claim"), self._stats.steps)
        super().act(numbers)

    def close(self) -> None:
        """Stop the threads."""
        super().close()
        self._outward_journeys.close()

    def _compute_rewards(self, rows: Int64[np.ndarray, "some"]) -> None:
        arguments = self._arguments.arguments(self._fields, self._judge.table)
        compute_reward(rows, arguments, CONTROL_STEP)

    def _reward_arguments(self, fields: DistanceFields, claims: Claims) -> tuple[Any, ...]:
        """Return the arguments of `compute_reward`."""
        return (
            self._config.weights.values,
            self._config.radius,
            self._cell_area,
            self.collided,
            fields,
            self._state,
            self._builder.progress,
            self._stats,
            self._homing,
            claims,
        )

    @property
    def ended(self) -> Bool[np.ndarray, "robots"]:
        """Which robots have declared home."""
        return self._homing.declared

    @property
    def claim_outcomes(self) -> Int64[np.ndarray, "robots"]:
        """What the claim of each robot would be now, if it were the first of its visit."""
        rooms = self._builder.progress.room
        return self._judge.outcomes(self.poses, rooms, self.path_lengths)

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        homing = self._homing
        return (
            super().facts
            | (self._judge.facts if self._config.claims else {})
            | {
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
        )


class HomingTask(WayHomeTask):
    """Robots that have explored and drive home.

    Args:
        robots: Number of robots.
        equipment: Equipment of the robots.
        config: Parameters of actions, observations, rewards and outward journeys.
        journeys: Number of outward journeys per start; 0 for a new one each time.

    Raises:
        InputError: `journeys` is negative, or the mapper is unknown.
    """

    environment: ClassVar[str] = "Albot/Homing-v0"

    def __init__(
        self,
        robots: int,
        equipment: Equipment,
        *,
        config: HomingConfig | None = None,
        journeys: int = 0,
    ) -> None:
        config = chosen_config(config, HomingConfig, self.environment)
        guide = ExploringGuide(equipment, config.outing)
        super().__init__(robots, equipment, config=config, guide=guide, journeys=journeys)
