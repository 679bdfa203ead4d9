"""The reward for exploring and coming home in time: its terms, their worth, when it is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.observation_parts import LogScale, observe_time
from albot_env.tasks.core.reward import Weights, set_reward
from albot_env.tasks.core.state import update_stats
from albot_env.tasks.core.way_home import success_weighted, update_way_home


class ExploreAndHomeTerms(NamedTuple):
    """The terms (see `ExploreAndHomeWeights`), in the order of `EpisodeStats.terms`."""

    coverage: float
    room: float
    success: float
    false_declaration: float
    late: float
    progress: float
    collision: float
    time: float


@dataclass(frozen=True, kw_only=True)
class ExploreAndHomeWeights(Weights):
    """What the terms of the reward for exploring and coming home are worth. A reward is their sum.

    Progress is shaped by a potential that grows with time (Devlin and Kudenko, Dynamic
    potential-based reward shaping, AAMAS 2012): Φ = -`progress` · true way home (m) · share of
    the budget that is spent, and 0 once the episode is over. It lets the robot go away
    at first and draws it home towards the end. As in `HomingWeights` the discounted terms sum
    to -Φ of the beginning, which is 0, whatever the robot did: the best policy is the one
    without shaping.
    """

    terms: ClassVar[Any] = ExploreAndHomeTerms

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    success: float = 10.0
    """For declaring home where it is, in time and with enough ground covered."""
    false_declaration: float = -5.0
    """For declaring home elsewhere, or having covered too little."""
    late: float = -5.0
    """For having declared nothing when the budget is spent."""
    progress: float = 0.1
    """For every metre that the way home gets shorter when time is up (1/m), see above."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = 0.0
    """For every second that passes (1/s): the budget is what presses."""
    discount: float = 0.995
    """The learner's own discount factor γ, of a step: with another one the best policy may
    change."""


class ExploreAndHomeStats(NamedTuple):
    """How robots fare that are to be home in time, a row each."""

    budgets: np.ndarray
    """(n,) int64: how many steps each has in all."""
    time_left: np.ndarray
    """(n,) float64: what is left of that (s)."""
    distances: np.ndarray
    """(n,) float64: the true way home (m)."""
    turns: np.ndarray
    """(n, 2) float64: where the true way home turns next (m, world frame)."""
    farthest: np.ndarray
    """(n,) float64: the longest that the way home has been (m)."""
    driven: np.ndarray
    """(n,) float64: how far it has truly driven since it was farthest from home (m)."""
    declares: np.ndarray
    """(n,) bool: whether its action declares that this is home."""
    declared: np.ndarray
    """(n,) bool: whether it has declared so."""
    success: np.ndarray
    """(n,) bool: whether that was true, with enough ground covered."""
    ended: np.ndarray
    """(n,) bool: whether its episode is over."""
    spl: np.ndarray
    """(n,) float64: success weighted by the length of the way back from where it was farthest."""
    soft_spl: np.ndarray
    """(n,) float64: the same with the share of that way covered in place of success."""


class Rules(NamedTuple):
    """What a round trip must have been to be a success, and how time is shown."""

    radius: float
    """How near home is home (m)."""
    ground: float
    """Ground that must be covered (m²)…"""
    share: float
    """…or this share of what can be reached, where that is less."""
    time_scale: LogScale
    """The scale on which the time left (s) is shown…"""
    time_at: int
    """…and where in observations it stands; -1 where it is not shown."""


def new_explore_and_home_stats(robots: int) -> ExploreAndHomeStats:
    """Those of so many robots that have not begun."""
    return ExploreAndHomeStats(
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


@KernelDispatcher
@kernel(nogil=True)
def compute_reward(
    rows: np.ndarray, arguments: KernelArguments, elapsed: float, observations: np.ndarray
) -> None:
    """Bring the statistics of robots up to date at the end of a step (s), and its reward.

    The time left is filled into each one's row of `observations`. `arguments` holds the weights
    (`ExploreAndHomeTerms`) and the discount of the reward, `Rules`, the area (m²) of a cell of
    ground, whether each robot touched something (n,), `DistanceFields`, `BatchState`, `Progress`,
    `EpisodeStats` and `ExploreAndHomeStats`.
    """
    weights, discount, rules, cell_area, collided, fields, state, progress, stats, trip = unpack(
        arguments
    )
    for i in rows:
        moved = update_stats(i, cell_area, state, progress, stats)
        steps, budget, before = stats.steps[i], trip.budgets[i], trip.distances[i]
        pose, start = state.poses[i], stats.starts[i]
        update_way_home(i, pose[0], pose[1], fields, trip)
        trip.declared[i] = trip.success[i] = trip.ended[i] = False
        trip.time_left[i] = (budget - steps) * elapsed
        if steps == 0:
            trip.farthest[i] = 0.0
        else:
            trip.driven[i] += moved
            trip.declared[i] = declared = trip.declares[i]
            apart = length_of(pose[0] - start[0], pose[1] - start[1])
            enough = min(rules.ground, rules.share * stats.reachable[i])
            explored = progress.ground[i] * cell_area >= enough
            trip.success[i] = success = declared and explored and apart <= rules.radius
            trip.ended[i] = ended = declared or steps >= budget
            # What home is worth as time goes by: see `ExploreAndHomeWeights`.
            drawn = before * (steps - 1) / budget
            if not ended:
                drawn -= discount * trip.distances[i] * steps / budget
            terms = ExploreAndHomeTerms(
                coverage=weights.coverage * progress.new_ground[i] * cell_area,
                room=weights.room if progress.new_room[i] else 0.0,
                success=weights.success if success else 0.0,
                false_declaration=weights.false_declaration if declared and not success else 0.0,
                late=weights.late if ended and not declared else 0.0,
                progress=weights.progress * drawn,
                collision=weights.collision if collided[i] else 0.0,
                time=weights.time * elapsed,
            )
            set_reward(i, terms, stats)
        if trip.distances[i] >= trip.farthest[i]:
            trip.farthest[i], trip.driven[i] = trip.distances[i], 0.0
        farthest, driven = trip.farthest[i], trip.driven[i]
        trip.spl[i] = success_weighted(1.0 if trip.success[i] else 0.0, farthest, driven)
        back = 0.0
        if farthest > 0.0:
            back = min(1.0, max(0.0, 1.0 - trip.distances[i] / farthest))
        trip.soft_spl[i] = success_weighted(back, farthest, driven)
        if rules.time_at >= 0:
            observations[i, rules.time_at] = observe_time(trip.time_left[i], rules.time_scale)
