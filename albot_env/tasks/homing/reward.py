"""The reward for coming home: its terms, their weights, and when they are given."""

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
from albot_env.tasks.core.way_home import is_home, judge_way_home, update_way_home


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
    """Weights of the terms of the homing reward. The reward is their sum.

    Two terms are potential-based shaping (Ng, Harada and Russell, Policy invariance under reward
    transformations, ICML 1999). Progress has the potential Φ = -`progress` · true way home (m).
    Facing has Φ = -`facing` · (1 - cos α) / 2, where α is the angle from the robot's heading to
    the next turn of the true way home. Both potentials are 0 once home is declared. A step's term
    is `discount` · Φ after it - Φ before it. So the discounted terms of an episode that ends with a
    declaration sum to -Φ of its beginning, whatever path the robot took, and the best policy is
    the same as without shaping.
    """

    terms: ClassVar[Any] = HomingTerms

    success: float = 10.0
    """For a true declaration of home."""
    false_declaration: float = -5.0
    """For a declaration elsewhere."""
    progress: float = 0.1
    """For every metre by which the way home gets shorter (1/m), see above."""
    facing: float = 0.5
    """For turning from facing away from the way home to facing it, see above. Without it, learners
    that start facing the wrong way drive on rather than turn."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""
    discount: float = 0.995
    """The learner's discount factor γ per step. If the learner uses another one, the best policy
    may change."""


class HomingStats(NamedTuple):
    """The robots' progress on their way home, one row per robot."""

    distances: np.ndarray
    """(n,) float64: true geodesic distance home (m)."""
    initial: np.ndarray
    """(n,) float64: the same at the beginning (m)."""
    aversions: np.ndarray
    """(n,) float64: how far the robot faces away from the next turn: 0 facing it, 1 opposite."""
    driven: np.ndarray
    """(n,) float64: true path length since the beginning (m)."""
    turns: np.ndarray
    """(n, 2) float64: next turn of the true way home (m, world frame)."""
    declares: np.ndarray
    """(n,) bool: whether the action declares home."""
    declared: np.ndarray
    """(n,) bool: whether the robot has declared home."""
    success: np.ndarray
    """(n,) bool: whether the declaration was true."""
    spl: np.ndarray
    """(n,) float64: success weighted by path length."""
    soft_spl: np.ndarray
    """(n,) float64: the same with the share of the way covered in place of success."""


def new_homing_stats(robots: int) -> HomingStats:
    """Return the statistics of robots that have not begun."""
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
    """Update statistics and rewards of robots at the end of a step of `elapsed` (s).

    `arguments` holds the weights (`HomingTerms`), the discount, the radius of home (m), the area
    (m²) of a coverage cell, whether each robot touched something (n,), `DistanceFields`,
    `BatchState`, `Progress`, `EpisodeStats` and `HomingStats`.
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
                homing.success[i] = is_success(pose, start, radius)
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
        homing.spl[i], homing.soft_spl[i] = judge_way_home(
            homing.success[i], homing.distances[i], homing.initial[i], homing.driven[i], 1.0
        )


@kernel()
def is_success(pose: np.ndarray, start: np.ndarray, radius: float) -> bool:
    """Return whether a declaration of home is true: the robot is within `radius` (m) of it."""
    return is_home(pose, start, radius)


@kernel()
def _aversion(pose: np.ndarray, turn: np.ndarray) -> float:
    """Return how far a robot faces away from a point, (1 - cos) / 2: 0 facing it, 1 opposite."""
    east, north = turn[0] - pose[0], turn[1] - pose[1]
    away = length_of(east, north)
    if away == 0.0:
        return 0.0
    return float(0.5 - 0.5 * (math.cos(pose[2]) * east + math.sin(pose[2]) * north) / away)
