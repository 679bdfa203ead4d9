"""The compiled worth of driving home."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.reward import Weights, check_discount
from albot_env.tasks.core.state import follow
from albot_env.tasks.core.way_home import find_way, success_weighted

TERMS = ("success", "false_declaration", "progress", "facing", "collision", "time")
"""The reward's terms, in the order of the columns of `Standing.terms`."""


class Homecoming(NamedTuple):
    """How far robots have come on their way home, a row each."""

    distances: np.ndarray
    """(n,) float64: the true way home (m)."""
    initial: np.ndarray
    """(n,) float64: the same at the beginning (m)."""
    aversions: np.ndarray
    """(n,) float64: how far it looks away from where that turns next, from 0 to 1 right behind."""
    driven: np.ndarray
    """(n,) float64: how far it has truly driven since (m)."""
    turns: np.ndarray
    """(n, 2) float64: where the true way home turns next (m, world frame)."""
    declares: np.ndarray
    """(n,) bool: whether its action declares that this is home."""
    declared: np.ndarray
    """(n,) bool: whether it has declared so."""
    success: np.ndarray
    """(n,) bool: whether that was true."""
    spl: np.ndarray
    """(n,) float64: success weighted by path length."""
    soft_spl: np.ndarray
    """(n,) float64: the same with the share of the way covered in place of success."""


@kernel()
def _aversion(pose: np.ndarray, turn: np.ndarray) -> float:
    """How far a robot looks away from a point, (1 - cos) / 2: 0 ahead, 1 right behind."""
    east, north = turn[0] - pose[0], turn[1] - pose[1]
    away = length_of(east, north)
    if away == 0.0:
        return 0.0
    return float(0.5 - 0.5 * (math.cos(pose[2]) * east + math.sin(pose[2]) * north) / away)


@KernelDispatcher
@kernel(nogil=True)
def appraise_homing(rows: np.ndarray, arguments: KernelArguments, elapsed: float) -> None:
    """Bring the standing of robots up to date after a survey, at the end of a step (s).

    `arguments` holds the weights (terms,) and the discount of the reward, how near home (m)
    counts as home, the area (m²) of a cell of ground, whether each robot touched something
    (n,), `Fields`, `Senses`, `Findings`, `Standing` and `Homecoming`.
    """
    weights, discount, radius, cell_area, collided, fields, senses, findings, standing, h = unpack(
        arguments
    )
    for i in rows:
        moved = follow(i, cell_area, senses, findings, standing)
        before, averse = h.distances[i], h.aversions[i]
        pose, start, terms = senses.poses[i], standing.starts[i], standing.terms[i]
        find_way(i, pose[0], pose[1], fields, h)
        h.aversions[i] = _aversion(pose, h.turns[i])
        h.declared[i] = h.success[i] = False
        if standing.steps[i] == 0:
            h.initial[i], h.driven[i] = h.distances[i], 0.0
        else:
            h.driven[i] += moved
            if h.declares[i]:
                h.declared[i] = True
                apart = length_of(pose[0] - start[0], pose[1] - start[1])
                h.success[i] = apart <= radius
            after = 0.0 if h.declared[i] else h.distances[i]
            averse_after = 0.0 if h.declared[i] else h.aversions[i]
            terms[0] = weights[0] if h.success[i] else 0.0
            terms[1] = weights[1] if h.declared[i] and not h.success[i] else 0.0
            terms[2] = weights[2] * (before - discount * after)
            terms[3] = weights[3] * (averse - discount * averse_after)
            terms[4] = weights[4] if collided[i] else 0.0
            terms[5] = weights[5] * elapsed
        h.spl[i] = success_weighted(1.0 if h.success[i] else 0.0, h.initial[i], h.driven[i])
        covered = 1.0
        if h.initial[i] > 0.0:
            covered = min(1.0, max(0.0, 1.0 - h.distances[i] / h.initial[i]))
        h.soft_spl[i] = success_weighted(covered, h.initial[i], h.driven[i])
        standing.rewards[i] = (
            terms[0] + terms[1] + terms[2] + terms[3] + terms[4] + terms[5]
        )  # In this order, as the sum of the terms by name is.


@dataclass(frozen=True, kw_only=True)
class HomingWeights(Weights):
    """What the terms of the homing reward are worth. A reward is their sum.

    Progress is shaped by a potential (Ng, Harada and Russell, Policy invariance under reward
    transformations, ICML 1999): Φ = -`progress` · true way home (m), and 0 once
    home was declared; and so is which way the robot looks, by Φ = -`facing` · (1 - cos α) / 2, α
    from its heading to where the true way home turns next. A step is worth `discount` · Φ after
    it - Φ before it, so that the discounted terms of an episode that ends with a declaration
    sum to -Φ of its beginning, whatever way the robot took, and the best policy is the one
    without shaping.
    """

    terms: ClassVar[tuple[str, ...]] = TERMS

    success: float = 10.0
    """For declaring home where it is."""
    false_declaration: float = -5.0
    """For declaring home elsewhere."""
    progress: float = 0.1
    """For every metre that the way home gets shorter (1/m), see above."""
    facing: float = 0.5
    """For turning from right away from the way home to face it, see above: without it learners
    who set out the wrong way drive on rather than turn."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""
    discount: float = 0.995
    """The learner's own discount factor γ, of a step: with another one the best policy may
    change."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_discount(self)
