"""The reward for exploring and coming home in time: its terms, and their weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.claims import FALSE, RIGHT, judge_claim
from albot_env.tasks.core.reward import Weights, set_reward
from albot_env.tasks.core.state import update_stats
from albot_env.tasks.core.way_home import is_home, judge_way_home, update_way_home


class ExploreAndHomeTerms(NamedTuple):
    """The terms (see `ExploreAndHomeWeights`), in the order of `EpisodeStats.terms`."""

    coverage: float
    room: float
    success: float
    false_declaration: float
    late: float
    progress: float
    place_recognized: float
    place_mistaken: float
    collision: float
    time: float


@dataclass(frozen=True, kw_only=True)
class ExploreAndHomeWeights(Weights):
    """Weights of the terms of the reward for exploring and coming home. The reward is their sum.

    Progress is the difference of a potential that grows with time (Devlin and Kudenko, Dynamic
    potential-based reward shaping, AAMAS 2012): Φ = -`progress` · true way home (m) · share of the
    budget that is spent. It lets the robot go away at first and draws it home towards the end. Its
    plain sum over an episode is Φ at the end, whatever the robot did before (see `HomingWeights`).
    """

    terms: ClassVar[Any] = ExploreAndHomeTerms

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    success: float = 10.0
    """For a true declaration of home, in time and with enough ground covered."""
    false_declaration: float = -5.0
    """For a declaration elsewhere, or with too little ground covered."""
    late: float = -5.0
    """For no declaration before the budget is spent."""
    progress: float = 0.1
    """For every metre by which the way home gets shorter when time is up (1/m), see above."""
    place_recognized: float = 1.0
    """For the first right claim in a room, if the agent claims (see `claims`)."""
    place_mistaken: float = -2.0
    """For every false claim: twice the pay of a right one, so that always claiming loses."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = 0.0
    """For every second that passes (1/s); 0 because the budget already limits the time."""


class ExploreAndHomeStats(NamedTuple):
    """The robots' progress in exploring and coming home, one row per robot."""

    budgets: np.ndarray
    """(n,) int64: total number of steps in the budget."""
    distances: np.ndarray
    """(n,) float64: true geodesic distance home (m)."""
    turns: np.ndarray
    """(n, 2) float64: next turn of the true way home (m, world frame)."""
    farthest: np.ndarray
    """(n,) float64: maximum distance home so far (m)."""
    driven: np.ndarray
    """(n,) float64: true path length since the robot was farthest from home (m)."""
    declares: np.ndarray
    """(n,) bool: whether the action declares home."""
    declared: np.ndarray
    """(n,) bool: whether the robot has declared home."""
    success: np.ndarray
    """(n,) bool: whether the declaration was true, with enough ground covered."""
    ended: np.ndarray
    """(n,) bool: whether the episode is over."""
    spl: np.ndarray
    """(n,) float64: success weighted by the length of the way back from where it was farthest."""
    soft_spl: np.ndarray
    """(n,) float64: the same with the share of that way covered in place of success."""


class Rules(NamedTuple):
    """Conditions of success."""

    radius: float
    """Radius of home (m)."""
    ground: float
    """Ground that must be covered (m²)."""
    share: float
    """Share of the reachable ground that suffices if it is less."""


def new_explore_and_home_stats(robots: int) -> ExploreAndHomeStats:
    """Return the statistics of robots that have not begun."""
    return ExploreAndHomeStats(
        budgets=np.ones(robots, np.int64),
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


@KernelDispatcher
@kernel(nogil=True)
def compute_reward(rows: np.ndarray, arguments: KernelArguments, elapsed: float) -> None:
    """Update statistics and rewards of robots at the end of a step of `elapsed` (s).

    `arguments` holds the weights (`ExploreAndHomeTerms`), `Rules`, the area (m²) of a coverage
    cell, whether each robot touched something (n,), `DistanceFields`, `BatchState`,
    `ExplorationProgress`, `EpisodeStats`, `ExploreAndHomeStats` and `Claims`.
    """
    weights, rules, cell_area, collided, fields, state, progress, stats, trip, claims = unpack(
        arguments
    )
    for i in rows:
        moved = update_stats(i, cell_area, state, progress, stats)
        steps, budget, before = stats.steps[i], trip.budgets[i], trip.distances[i]
        pose, start = state.poses[i], stats.starts[i]
        update_way_home(i, pose[0], pose[1], fields, trip)
        trip.declared[i] = trip.success[i] = trip.ended[i] = False
        room, is_new = progress.room[i], progress.new_room[i]
        claim = judge_claim(i, steps, stats.path_lengths[i], pose, room, is_new, claims)
        if steps == 0:
            trip.farthest[i] = 0.0
        else:
            trip.driven[i] += moved
            trip.declared[i] = declared = trip.declares[i]
            covered = progress.ground[i] * cell_area
            success = declared and is_success(pose, start, covered, stats.reachable[i], rules)
            trip.success[i] = success
            trip.ended[i] = ended = declared or steps >= budget
            # The weight of the way home grows with time: see `ExploreAndHomeWeights`.
            drawn = (before * (steps - 1) - trip.distances[i] * steps) / budget
            terms = ExploreAndHomeTerms(
                coverage=weights.coverage * progress.new_ground[i] * cell_area,
                room=weights.room if progress.new_room[i] else 0.0,
                success=weights.success if success else 0.0,
                false_declaration=weights.false_declaration if declared and not success else 0.0,
                late=weights.late if ended and not declared else 0.0,
                progress=weights.progress * drawn,
                place_recognized=weights.place_recognized if claim == RIGHT else 0.0,
                place_mistaken=weights.place_mistaken if claim == FALSE else 0.0,
                collision=weights.collision if collided[i] else 0.0,
                time=weights.time * elapsed,
            )
            set_reward(i, terms, stats)
        if trip.distances[i] >= trip.farthest[i]:
            trip.farthest[i], trip.driven[i] = trip.distances[i], 0.0
        trip.spl[i], trip.soft_spl[i] = judge_way_home(
            trip.success[i], trip.distances[i], trip.farthest[i], trip.driven[i], 0.0
        )


@kernel()
def is_success(
    pose: np.ndarray, start: np.ndarray, covered: float, reachable: float, rules: Rules
) -> bool:
    """Return whether a robot that declares home has explored enough and is home.

    `covered` and `reachable` are areas (m²).
    """
    enough = min(rules.ground, rules.share * reachable)
    return covered >= enough and is_home(pose, start, rules.radius)
