"""The compiled worth of exploring and coming home in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.observation_parts import LogScale, observe_time
from albot_env.tasks.core.reward import Weights, check_discount
from albot_env.tasks.core.state import follow
from albot_env.tasks.core.way_home import find_way, success_weighted

TERMS = (
    "coverage", "room", "success", "false_declaration", "late", "progress", "collision", "time",
)  # fmt: skip
"""The reward's terms, in the order of the columns of `Standing.terms`."""


class RoundTrips(NamedTuple):
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


@KernelDispatcher
@kernel(nogil=True)
def appraise_round_trip(
    rows: np.ndarray, arguments: KernelArguments, elapsed: float, observations: np.ndarray
) -> None:
    """Bring the standing of robots up to date after a survey, at the end of a step (s).

    The time left is filled into each one's row of `observations`. `arguments` holds the
    weights (terms,) and the discount of the reward, `Rules`, the area (m²) of a cell of ground,
    whether each robot touched something (n,), `Fields`, `Senses`, `Findings`, `Standing` and
    `RoundTrips`.
    """
    weights, discount, rules, cell_area, collided, fields, senses, findings, standing, r = unpack(
        arguments
    )
    for i in rows:
        moved = follow(i, cell_area, senses, findings, standing)
        steps, budget, before = standing.steps[i], r.budgets[i], r.distances[i]
        pose, start, terms = senses.poses[i], standing.starts[i], standing.terms[i]
        find_way(i, pose[0], pose[1], fields, r)
        r.declared[i] = r.success[i] = r.ended[i] = False
        r.time_left[i] = (budget - steps) * elapsed
        if steps == 0:
            r.farthest[i] = 0.0
        else:
            r.driven[i] += moved
            r.declared[i] = r.declares[i]
            apart = length_of(pose[0] - start[0], pose[1] - start[1])
            enough = min(rules.ground, rules.share * standing.reachable[i])
            explored = findings.ground[i] * cell_area >= enough
            r.success[i] = r.declared[i] and explored and apart <= rules.radius
            r.ended[i] = r.declared[i] or steps >= budget
            # What is home worth as time goes by: see `RoundTripWeights`.
            drawn = before * (steps - 1) / budget
            if not r.ended[i]:
                drawn -= discount * r.distances[i] * steps / budget
            terms[0] = weights[0] * findings.new_ground[i] * cell_area
            terms[1] = weights[1] if findings.new_room[i] else 0.0
            terms[2] = weights[2] if r.success[i] else 0.0
            terms[3] = weights[3] if r.declared[i] and not r.success[i] else 0.0
            terms[4] = weights[4] if r.ended[i] and not r.declared[i] else 0.0
            terms[5] = weights[5] * drawn
            terms[6] = weights[6] if collided[i] else 0.0
            terms[7] = weights[7] * elapsed
        if r.distances[i] >= r.farthest[i]:
            r.farthest[i], r.driven[i] = r.distances[i], 0.0
        _weigh(i, r)
        total = 0.0
        for k in range(terms.shape[0]):
            total += terms[k]
        standing.rewards[i] = total
        if rules.time_at >= 0:
            observations[i, rules.time_at] = observe_time(r.time_left[i], rules.time_scale)


@kernel()
def _weigh(i: int, r: RoundTrips) -> None:
    """Weigh success, and the share of the way back that robot i has come, by their length."""
    farthest = r.farthest[i]
    r.spl[i] = success_weighted(1.0 if r.success[i] else 0.0, farthest, r.driven[i])
    back = 0.0
    if farthest > 0.0:
        back = min(1.0, max(0.0, 1.0 - r.distances[i] / farthest))
    r.soft_spl[i] = success_weighted(back, farthest, r.driven[i])


@dataclass(frozen=True, kw_only=True)
class RoundTripWeights(Weights):
    """What the terms of the reward for exploring and coming home are worth. A reward is their sum.

    Progress is shaped by a potential that grows with time (Devlin and Kudenko, Dynamic
    potential-based reward shaping, AAMAS 2012): Φ = -`progress` · true way home (m) · share of
    the budget that is spent, and 0 once the episode is over. It lets the robot go away
    at first and draws it home towards the end. As in `HomingWeights` the discounted terms sum
    to -Φ of the beginning, which is 0, whatever the robot did: the best policy is the one
    without shaping.
    """

    terms: ClassVar[tuple[str, ...]] = TERMS

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

    def __post_init__(self) -> None:
        super().__post_init__()
        check_discount(self)
