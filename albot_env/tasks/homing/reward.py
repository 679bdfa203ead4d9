"""The reward for coming home: its terms, their weights, and when they are given."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.claims import FALSE, RIGHT, judge_claim
from albot_env.tasks.core.reward import Weights, set_reward
from albot_env.tasks.core.state import update_stats
from albot_env.tasks.core.way_home import is_home, judge_way_home, update_way_home


class HomingTerms(NamedTuple):
    """The terms (see `HomingWeights`), in the order of the columns of `EpisodeStats.terms`."""

    success: float
    false_declaration: float
    progress: float
    facing: float
    place_recognized: float
    place_mistaken: float
    collision: float
    time: float


@dataclass(frozen=True, kw_only=True)
class HomingWeights(Weights):
    """Weights of the terms of the homing reward. The reward is their sum.

    Two terms are differences of potentials: a step's term is Φ after it - Φ before it. Progress
    has Φ = -`progress` · true way home (m). Facing has Φ = -`facing` · (1 - cos α) / 2, where α is
    the angle from the robot's heading to the next turn of the true way home. So the plain sum of
    an episode's terms depends on nothing but where the robot began and where it ended (and on what
    faults of the world do to it, for which nothing is paid): driving to
    and fro, or waiting, gains nothing, and whoever adds up rewards ranks policies as a learner
    does that discounts them. Ng, Harada and Russell (Policy invariance under reward
    transformations, ICML 1999) multiply Φ after a step by the learner's discount γ, which leaves
    the best policy as it is without shaping. Here a learner with γ < 1 also sees a cost of (1 - γ)
    Φ for each step away from home, as if `time` cost a little more there.
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
    place_recognized: float = 1.0
    """For the first right claim in a room, if the agent claims (see `claims`)."""
    place_mistaken: float = -2.0
    """For every false claim: twice the pay of a right one, so that always claiming loses."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""


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

    `arguments` holds the weights (`HomingTerms`), the radius of home (m), the area (m²) of a
    coverage cell, whether each robot touched something (n,), `DistanceFields`, `BatchState`,
    `ExplorationProgress`, `EpisodeStats`, `HomingStats` and `Claims`.
    """
    weights, radius, cell_area, collided, fields, state, progress, stats, homing, claims = unpack(
        arguments
    )
    for i in rows:
        moved = update_stats(i, cell_area, state, progress, stats)
        before, averse = homing.distances[i], homing.aversions[i]
        pose, start = state.poses[i], stats.starts[i]
        update_way_home(i, pose[0], pose[1], fields, homing)
        homing.aversions[i] = aversion(pose, homing.turns[i])
        homing.declared[i] = homing.success[i] = False
        room, is_new = progress.room[i], progress.new_room[i]
        claim = judge_claim(
            i, stats.steps[i], stats.path_lengths[i], state.poses[i], room, is_new, claims
        )
        if stats.steps[i] == 0:
            homing.initial[i], homing.driven[i] = homing.distances[i], 0.0
        else:
            homing.driven[i] += moved
            if homing.declares[i]:
                homing.declared[i] = True
                homing.success[i] = is_success(pose, start, radius)
            declared, success = homing.declared[i], homing.success[i]
            terms = HomingTerms(
                success=weights.success if success else 0.0,
                false_declaration=weights.false_declaration if declared and not success else 0.0,
                progress=weights.progress * (before - homing.distances[i]),
                facing=weights.facing * (averse - homing.aversions[i]),
                place_recognized=weights.place_recognized if claim == RIGHT else 0.0,
                place_mistaken=weights.place_mistaken if claim == FALSE else 0.0,
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
def aversion(pose: np.ndarray, turn: np.ndarray) -> float:
    """Return how far a robot faces away from a point, (1 - cos) / 2: 0 facing it, 1 opposite."""
    east, north = turn[0] - pose[0], turn[1] - pose[1]
    away = length_of(east, north)
    if away == 0.0:
        return 0.0
    return float(0.5 - 0.5 * (math.cos(pose[2]) * east + math.sin(pose[2]) * north) / away)
