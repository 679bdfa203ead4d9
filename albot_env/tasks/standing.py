"""How robots that explore stand: what their steps were worth, and how far off they are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from albot_core.parcel import Parcel, opened

TERMS = ("coverage", "room", "collision", "time")
"""The reward's terms, in the order of the columns of `Standing.terms`."""


class Standing(NamedTuple):
    """A row for each robot."""

    starts: np.ndarray
    """(n, 3) float64: where it set out (world frame): the origin of its map's frame."""
    steps: np.ndarray
    """(n,) int64: how many control steps it has taken."""
    reachable: np.ndarray
    """(n,) float64: the ground that it can reach (m²)."""
    before: np.ndarray
    """(n, 2) float64: where it was when last appraised (world frame)."""
    path_lengths: np.ndarray
    """(n,) float64: how far it has truly driven (m)."""
    position_errors: np.ndarray
    """(n,) float64: distance from its true position to the believed one (m)."""
    coverages: np.ndarray
    """(n,) float64: share of the ground that can be reached which it has covered."""
    terms: np.ndarray
    """(n, terms) float64: what its last step was worth, see TERMS; nothing for setting out."""
    rewards: np.ndarray
    """(n,) float64: their sum."""


def new_standing(robots: int) -> Standing:
    """The standing of robots that have done nothing."""
    return Standing(
        starts=np.zeros((robots, 3)),
        steps=np.zeros(robots, np.int64),
        reachable=np.ones(robots),
        before=np.zeros((robots, 2)),
        path_lengths=np.zeros(robots),
        position_errors=np.zeros(robots),
        coverages=np.zeros(robots),
        terms=np.zeros((robots, len(TERMS))),
        rewards=np.zeros(robots),
    )


@njit(cache=True, error_model="numpy", nogil=True)
def appraise(rows: np.ndarray, parcel: Parcel, elapsed: float) -> None:
    """Bring the standing of robots up to date after a survey, at the end of a step (s).

    The parcel holds the weights (terms,) of the reward, the area (m²) of a cell of ground,
    whether each robot touched something (n,), `Senses`, `Findings` and `Standing`.
    """
    weights, cell_area, collided, senses, findings, standing = opened(parcel)
    for i in rows:
        pose, belief, start = senses.poses[i], senses.beliefs[i], standing.starts[i]
        before, terms = standing.before[i], standing.terms[i]
        standing.path_lengths[i] += math.hypot(pose[0] - before[0], pose[1] - before[1])
        before[0], before[1] = pose[0], pose[1]
        cos, sin = math.cos(start[2]), math.sin(start[2])
        x = start[0] + cos * belief[0] - sin * belief[1]
        y = start[1] + sin * belief[0] + cos * belief[1]
        standing.position_errors[i] = math.hypot(x - pose[0], y - pose[1])
        share = findings.ground[i] * cell_area / standing.reachable[i]
        standing.coverages[i] = min(1.0, share)
        for k in range(terms.shape[0]):
            terms[k] = 0.0
        if standing.steps[i] > 0:
            terms[0] = weights[0] * findings.new_ground[i] * cell_area
            terms[1] = weights[1] if findings.new_room[i] else 0.0
            terms[2] = weights[2] if collided[i] else 0.0
            terms[3] = weights[3] * elapsed
        standing.rewards[i] = terms[0] + terms[1] + terms[2] + terms[3]
