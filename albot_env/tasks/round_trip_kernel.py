"""The compiled worth of exploring and coming home in time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.directions import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.homing_kernel import find_way, success_weighted
from albot_env.tasks.kernels import observe_time
from albot_env.tasks.log_scale import LogScale
from albot_env.tasks.standing import follow

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
