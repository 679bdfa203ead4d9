"""The reward for coming home: its terms, what each is worth, and when it is given."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.reward import Weights, set_reward
from albot_env.tasks.core.state import update_stats
from albot_env.tasks.core.way_home import success_weighted, update_way_home


class HomingTerms(NamedTuple):
    """The terms (see `HomingWeights`), in the order of the columns of `EpisodeStats.terms`."""

    success: float
    false_declaration: float
    progress: float
    facing: float
    collision: float
    time: float


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

    terms: ClassVar[Any] = HomingTerms

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


class HomingStats(NamedTuple):
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


def new_homing_stats(robots: int) -> HomingStats:
    """Those of so many robots that have not begun."""
    return HomingStats(
        distances=np.zeros(robots),
        initial=np.zeros(robots),
        aversions=np.zeros(robots),
        driven=np.zeros(robots),
        turns=np.zeros((robots, 2)),
        declares=np.zeros(robots, np.bool_),
        declared=np.zeros(robots, np.bool_),
        success=np.zeros(robots, np.bool_),
        spl=np.zeros(robots),
        soft_spl=np.zeros(robots),
    )


@KernelDispatcher
@kernel(nogil=True)
def compute_reward(rows: np.ndarray, arguments: KernelArguments, elapsed: float) -> None:
    """Bring the statistics of robots up to date at the end of a step (s), and its reward.

    `arguments` holds the weights (`HomingTerms`) and the discount of the reward, how near home (m)
    counts as home, the area (m²) of a cell of ground, whether each robot touched something
    (n,), `DistanceFields`, `BatchState`, `Progress`, `EpisodeStats` and `HomingStats`.
    """
    weights, discount, radius, cell_area, collided, fields, state, progress, stats, homing = unpack(
        arguments
    )
    for i in rows:
        moved = update_stats(i, cell_area, state, progress, stats)
        before, averse = homing.distances[i], homing.aversions[i]
        pose, start = state.poses[i], stats.starts[i]
        update_way_home(i, pose[0], pose[1], fields, homing)
        homing.aversions[i] = _aversion(pose, homing.turns[i])
        homing.declared[i] = homing.success[i] = False
        if stats.steps[i] == 0:
            homing.initial[i], homing.driven[i] = homing.distances[i], 0.0
        else:
            homing.driven[i] += moved
            if homing.declares[i]:
                homing.declared[i] = True
                apart = length_of(pose[0] - start[0], pose[1] - start[1])
                homing.success[i] = apart <= radius
            declared, success = homing.declared[i], homing.success[i]
            # The potentials are 0 once home is declared: see `HomingWeights`.
            after = 0.0 if declared else homing.distances[i]
            averse_after = 0.0 if declared else homing.aversions[i]
            terms = HomingTerms(
                success=weights.success if success else 0.0,
                false_declaration=weights.false_declaration if declared and not success else 0.0,
                progress=weights.progress * (before - discount * after),
                facing=weights.facing * (averse - discount * averse_after),
                collision=weights.collision if collided[i] else 0.0,
                time=weights.time * elapsed,
            )
            set_reward(i, terms, stats)
        initial, driven = homing.initial[i], homing.driven[i]
        homing.spl[i] = success_weighted(1.0 if homing.success[i] else 0.0, initial, driven)
        covered = 1.0
        if initial > 0.0:
            covered = min(1.0, max(0.0, 1.0 - homing.distances[i] / initial))
        homing.soft_spl[i] = success_weighted(covered, initial, driven)


@kernel()
def _aversion(pose: np.ndarray, turn: np.ndarray) -> float:
    """How far a robot looks away from a point, (1 - cos) / 2: 0 ahead, 1 right behind."""
    east, north = turn[0] - pose[0], turn[1] - pose[1]
    away = length_of(east, north)
    if away == 0.0:
        return 0.0
    return float(0.5 - 0.5 * (math.cos(pose[2]) * east + math.sin(pose[2]) * north) / away)
