"""How robots stand: what their steps were worth, and how far off they are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of, wrap_angle
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel


class Standing(NamedTuple):
    """A row for each robot."""

    starts: np.ndarray
    """(n, 3) float64: where it set out (world frame): the origin of its map's frame."""
    turns: np.ndarray
    """(n, 2) float64: cosine and sine of the heading with which it set out."""
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
    """(n, terms) float64: what its last step was worth by the task's terms; nothing for setting
    out."""
    rewards: np.ndarray
    """(n,) float64: their sum."""


def new_standing(robots: int, terms: int) -> Standing:
    """The standing of robots that have done nothing, with so many terms of the reward."""
    return Standing(
        starts=np.zeros((robots, 3)),
        turns=np.zeros((robots, 2)),
        steps=np.zeros(robots, np.int64),
        reachable=np.ones(robots),
        before=np.zeros((robots, 2)),
        path_lengths=np.zeros(robots),
        position_errors=np.zeros(robots),
        coverages=np.zeros(robots),
        terms=np.zeros((robots, terms)),
        rewards=np.zeros(robots),
    )


def set_out(row: int, start: Pose, standing: Standing) -> None:
    """Let a robot stand where it sets out, before its first step."""
    standing.starts[row] = start
    standing.turns[row] = math.cos(start[2]), math.sin(start[2])
    standing.steps[row] = 0


@kernel()
def follow(
    i: int, cell_area: float, senses: Senses, findings: Findings, standing: Standing
) -> float:
    """Bring robot i's standing up to date after a survey; return how far it has driven (m).

    Its terms are set to zero. `cell_area` (m²) is that of a cell of ground.
    """
    pose, belief, start = senses.poses[i], senses.beliefs[i], standing.starts[i]
    before, terms = standing.before[i], standing.terms[i]
    driven = length_of(pose[0] - before[0], pose[1] - before[1])
    standing.path_lengths[i] += driven
    before[0], before[1] = pose[0], pose[1]
    cos, sin = standing.turns[i]
    x = start[0] + cos * belief[0] - sin * belief[1]
    y = start[1] + sin * belief[0] + cos * belief[1]
    standing.position_errors[i] = length_of(x - pose[0], y - pose[1])
    share = findings.ground[i] * cell_area / standing.reachable[i]
    standing.coverages[i] = min(1.0, share)
    for k in range(terms.shape[0]):
        terms[k] = 0.0
    return driven


@kernel(nogil=True)
def trail(
    rows: np.ndarray, cell_area: float, senses: Senses, findings: Findings, standing: Standing
) -> None:
    """Bring the standing of robots to which nothing is worth anything up to date."""
    for i in rows:
        follow(i, cell_area, senses, findings, standing)


class Senses(NamedTuple):
    """What all robots know; a row each."""

    poses: np.ndarray
    """(n, 3) float64: where they truly are (world frame)."""
    beliefs: np.ndarray
    """(n, 3) float64: where they believe to be (map frame)."""
    home_places: np.ndarray
    """(n, 3) float64: where they believe home to be (map frame)."""
    ways_home: np.ndarray
    """(n, 7) float64: the ways home that they believe in (see `albot_core.mappers.mapper`)."""
    places: np.ndarray
    """(n, 2) bool: whether they are in a place that they know from before; have lost their way."""
    homes: np.ndarray
    """(n, 3) float64: where they believe home to be (robot frame); found by the survey."""
    motions: np.ndarray
    """(n, 3) float64: what the odometers measured."""
    ranges: np.ndarray
    """(n, beams) float64: what the lasers saw (m)."""
    echoes: np.ndarray
    """(n, sonars) float64: what the sonars heard (m)."""


class Findings(NamedTuple):
    """What is found out about all robots; a row each."""

    ground: np.ndarray
    """(n,) int64: cells of ground truly covered since the start."""
    new_ground: np.ndarray
    """(n,) int64: those newly covered."""
    room: np.ndarray
    """(n,) int64: the room of its world that each is in; -1 between rooms."""
    new_room: np.ndarray
    """(n,) bool: whether it is entered for the first time."""
    rooms_entered: np.ndarray
    """(n,) int64: how many each has been in."""
    moved: np.ndarray
    """(n, 2) float64: way and turning since each last looked at the ground (m, rad)."""


@kernel(nogil=True)
def reckon(rows: np.ndarray, motions: np.ndarray, beliefs: np.ndarray, travels: np.ndarray) -> None:
    """Add the motions measured to beliefs x, y, heading (n, 3), their lengths to travels (n,)."""
    for i in rows:
        travels[i] += length_of(motions[i, 0], motions[i, 1])
        cos, sin = math.cos(beliefs[i, 2]), math.sin(beliefs[i, 2])
        beliefs[i, 0] += cos * motions[i, 0] - sin * motions[i, 1]
        beliefs[i, 1] += sin * motions[i, 0] + cos * motions[i, 1]
        beliefs[i, 2] = wrap_angle(beliefs[i, 2] + motions[i, 2])
