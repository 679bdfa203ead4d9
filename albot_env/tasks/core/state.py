"""The state of batched robots: what they sense and believe, their progress, their statistics."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of, rotate, transform_point, wrap_angle
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel


class BatchState(NamedTuple):
    """Where all robots are, what they believe and what they sensed last; a row each.

    It holds the truth too: observations are made of the other arrays.
    """

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
    """(n, 3) float64: where they believe home to be (robot frame); found as it is observed."""
    motions: np.ndarray
    """(n, 3) float64: what the odometers measured."""
    ranges: np.ndarray
    """(n, beams) float64: what the lasers saw (m)."""
    echoes: np.ndarray
    """(n, sonars) float64: what the sonars heard (m)."""


class Progress(NamedTuple):
    """What all robots have truly covered and entered; a row each."""

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
    """(n, 2) float64: way and turning since ground was last marked as covered (m, rad)."""


class EpisodeStats(NamedTuple):
    """How the episodes of all robots go, and what their last steps were worth; a row each."""

    starts: np.ndarray
    """(n, 3) float64: where it set out (world frame): the origin of its map's frame."""
    turns: np.ndarray
    """(n, 2) float64: cosine and sine of the heading with which it set out."""
    steps: np.ndarray
    """(n,) int64: how many control steps it has taken."""
    reachable: np.ndarray
    """(n,) float64: the ground that it can reach (m²)."""
    before: np.ndarray
    """(n, 2) float64: where it was at the last update (world frame)."""
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


def new_stats(robots: int, terms: int) -> EpisodeStats:
    """Those of so many robots that have not begun, with so many terms of the reward."""
    return EpisodeStats(
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


def begin_stats(row: int, start: Pose, stats: EpisodeStats) -> None:
    """Let a robot stand where it sets out, before its first step."""
    stats.starts[row] = start
    stats.turns[row] = math.cos(start[2]), math.sin(start[2])
    stats.steps[row] = 0


@kernel()
def update_stats(
    i: int, cell_area: float, state: BatchState, progress: Progress, stats: EpisodeStats
) -> float:
    """Bring robot i's statistics up to date after a look; return how far it has driven (m).

    Its reward is set to zero. `cell_area` (m²) is that of a cell of ground.
    """
    pose, belief, start = state.poses[i], state.beliefs[i], stats.starts[i]
    before, terms = stats.before[i], stats.terms[i]
    driven = length_of(pose[0] - before[0], pose[1] - before[1])
    stats.path_lengths[i] += driven
    before[0], before[1] = pose[0], pose[1]
    cos, sin = stats.turns[i]
    x, y = transform_point(start, cos, sin, belief[0], belief[1])
    stats.position_errors[i] = length_of(x - pose[0], y - pose[1])
    share = progress.ground[i] * cell_area / stats.reachable[i]
    stats.coverages[i] = min(1.0, share)
    for k in range(terms.shape[0]):
        terms[k] = 0.0
    stats.rewards[i] = 0.0
    return driven


@kernel(nogil=True)
def update_all_stats(
    rows: np.ndarray, cell_area: float, state: BatchState, progress: Progress, stats: EpisodeStats
) -> None:
    """Bring the statistics of robots `rows` up to date where no task rewards them."""
    for i in rows:
        update_stats(i, cell_area, state, progress, stats)


@kernel(nogil=True)
def integrate_odometry(
    rows: np.ndarray, motions: np.ndarray, beliefs: np.ndarray, travels: np.ndarray
) -> None:
    """Add the motions measured to beliefs x, y, heading (n, 3), their lengths to travels (n,)."""
    for i in rows:
        travels[i] += length_of(motions[i, 0], motions[i, 1])
        cos, sin = math.cos(beliefs[i, 2]), math.sin(beliefs[i, 2])
        east, north = rotate(cos, sin, motions[i, 0], motions[i, 1])
        beliefs[i, 0] += east
        beliefs[i, 1] += north
        beliefs[i, 2] = wrap_angle(beliefs[i, 2] + motions[i, 2])
