"""State arrays of batched robots: readings, beliefs, progress and statistics."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of, rotate, transform_point, wrap_angle
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel


class BatchState(NamedTuple):
    """True poses, beliefs and latest readings of all robots, one row per robot.

    The true poses and ranges are not used in observations.
    """

    poses: np.ndarray
    """(n, 3) float64: true poses (world frame)."""
    beliefs: np.ndarray
    """(n, 3) float64: believed poses (map frame)."""
    homes_in_map: np.ndarray
    """(n, 3) float64: believed poses of home (map frame)."""
    ways_home: np.ndarray
    """(n, 7) float64: believed ways home (see `albot_core.mappers.mapper`)."""
    is_recognised: np.ndarray
    """(n,) bool: whether the robot is in a place that it knows."""
    is_lost: np.ndarray
    """(n,) bool: whether the robot is lost."""
    homes_in_robot: np.ndarray
    """(n, 3) float64: believed poses of home (robot frame); filled in during observation."""
    motions: np.ndarray
    """(n, 3) float64: motions that the odometers measured (m, rad)."""
    true_ranges: np.ndarray
    """(n, beams) float64: distances of what the lasers' beams meet (m)."""
    ranges: np.ndarray
    """(n, beams) float64: ranges of the lasers (m)."""
    echoes: np.ndarray
    """(n, sonars) float64: ranges of the sonars (m)."""
    compasses: np.ndarray
    """(n,) float64: headings by the compasses (rad); 0 without compasses."""
    time_left: np.ndarray
    """(n,) float64: remaining time (s); infinite in tasks without a time budget."""
    starts: np.ndarray
    """(n, 3) float64: true poses at the start, which is home (world frame)."""
    true_homes: np.ndarray
    """(n, 3) float64: true poses of home (robot frame); filled in where the truth is revealed."""


@kernel()
def true_state(state: BatchState) -> BatchState:
    """Return the state of robots that know the truth: their map is the world."""
    return BatchState(
        state.poses,
        state.poses,
        state.starts,
        state.ways_home,
        state.is_recognised,
        state.is_lost,
        state.true_homes,
        state.motions,
        state.true_ranges,
        state.ranges,
        state.echoes,
        state.compasses,
        state.time_left,
        state.starts,
        state.true_homes,
    )


class ExplorationProgress(NamedTuple):
    """Ground truly covered and rooms truly entered by all robots, one row per robot."""

    ground: np.ndarray
    """(n,) int64: cells of ground truly covered since the start."""
    new_ground: np.ndarray
    """(n,) int64: cells newly covered in the last step."""
    room: np.ndarray
    """(n,) int64: index of the robot's room in its world; -1 between rooms."""
    new_room: np.ndarray
    """(n,) bool: whether the room was entered for the first time."""
    rooms_entered: np.ndarray
    """(n,) int64: number of rooms entered."""
    moved: np.ndarray
    """(n, 2) float64: distance and turning since coverage was last updated (m, rad)."""


class EpisodeStats(NamedTuple):
    """Statistics of all robots' episodes, and rewards of their last steps; one row per robot."""

    starts: np.ndarray
    """(n, 3) float64: start pose (world frame), the origin of the map frame."""
    turns: np.ndarray
    """(n, 2) float64: cosine and sine of the start heading."""
    steps: np.ndarray
    """(n,) int64: number of control steps taken."""
    reachable: np.ndarray
    """(n,) float64: area of the reachable ground (m²)."""
    before: np.ndarray
    """(n, 2) float64: position at the last update (world frame)."""
    path_lengths: np.ndarray
    """(n,) float64: true path length (m)."""
    position_errors: np.ndarray
    """(n,) float64: distance between true and believed position (m)."""
    coverages: np.ndarray
    """(n,) float64: share of the reachable ground that is covered."""
    terms: np.ndarray
    """(n, terms) float64: reward terms of the last step; zeros after a reset."""
    rewards: np.ndarray
    """(n,) float64: sums of the terms."""


def new_stats(robots: int, terms: int) -> EpisodeStats:
    """Return statistics for robots without an episode, and a number of reward terms."""
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
    """Reset a robot's statistics to its start, before its first step."""
    stats.starts[row] = start
    stats.turns[row] = math.cos(start[2]), math.sin(start[2])
    stats.steps[row] = 0


@kernel()
def update_stats(
    i: int, cell_area: float, state: BatchState, progress: ExplorationProgress, stats: EpisodeStats
) -> float:
    """Update robot i's statistics after a reading; return the distance driven since the last (m).

    The robot's reward is set to zero. `cell_area` (m²) is the area of a coverage cell.
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
    rows: np.ndarray,
    cell_area: float,
    state: BatchState,
    progress: ExplorationProgress,
    stats: EpisodeStats,
) -> None:
    """Update the statistics of robots `rows` in tasks without a reward."""
    for i in rows:
        update_stats(i, cell_area, state, progress, stats)


@kernel(nogil=True)
def integrate_odometry(
    rows: np.ndarray, motions: np.ndarray, beliefs: np.ndarray, travels: np.ndarray
) -> None:
    """Add measured motions to beliefs x, y, heading (n, 3), and their lengths to `travels` (n,)."""
    for i in rows:
        travels[i] += length_of(motions[i, 0], motions[i, 1])
        cos, sin = math.cos(beliefs[i, 2]), math.sin(beliefs[i, 2])
        east, north = rotate(cos, sin, motions[i, 0], motions[i, 1])
        beliefs[i, 0] += east
        beliefs[i, 1] += north
        beliefs[i, 2] = wrap_angle(beliefs[i, 2] + motions[i, 2])
