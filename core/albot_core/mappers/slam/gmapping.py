"""GMapping: grid maps by particles, drawn from a proposal that uses the scan and the odometry.

G. Grisetti, C. Stachniss and W. Burgard, Improved techniques for grid mapping with
Rao-Blackwellized particle filters, IEEE Transactions on Robotics 23 (2007): algorithm 1, in
`GMapping.update`. Parameters and beam model are those of the authors' program
(openslam.org/gmapping.html).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import wrap_angle
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.beam_model import (
    BeamConfig,
    BeamTables,
    beam_tables,
    cut_patch,
    weigh_points,
)
from albot_core.mappers.slam.particle_slam import ParticleSlam, ParticleSlamConfig
from albot_core.mappers.slam.particles import Particles
from albot_core.mappers.slam.tiles import PoolArrays
from albot_core.matching.scan_points import matched_points
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields
from albot_core.sensing.reading import LaserScan

_SAMPLES = Range("a whole number from 1 to 15", 1.0, 15.0, whole=True)
_ITERATIONS = Range("a whole number from 0 to 100", 0.0, 100.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class GMappingConfig(ParticleSlamConfig):
    """Parameters of GMapping. Defaults are those of the authors' program, except where noted."""

    beams: BeamConfig = field(default_factory=BeamConfig)
    """Comparison of scans with maps."""
    length_step: float = 0.05
    """First step in position of the search for the best pose (m; lstep)."""
    angle_step: float = 0.05
    """First step in heading of the search for the best pose (rad; astep)."""
    iterations: int = 5
    """Number of times that the steps are halved, 100 at most."""
    least_score: float = 0.0
    """Mean score of the beams that a match must exceed."""
    samples: int = 3
    """Number of poses along each axis around the best one at which the proposal is evaluated. The
    paper's K is its cube. The program has no proposal and takes the best pose, as 1 does here. 15
    at most."""
    sample_step: float = 0.02
    """Spacing of these poses in position (m); not in the program."""
    sample_turn: float = math.radians(0.5)
    """Spacing of these poses in heading (rad); not in the program."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, _SAMPLES, "samples")
        check_fields(self, _ITERATIONS, "iterations")
        check_fields(self, NOT_NEGATIVE, "least_score")
        check_fields(self, POSITIVE, "length_step", "angle_step", "sample_step", "sample_turn")


class Search(NamedTuple):
    """Parameters of the search for the best pose, for compiled code."""

    length_step: float
    angle_step: float
    iterations: int
    samples: int
    sample_step: float
    sample_turn: float
    least_score: float


class GMapping(ParticleSlam):
    """The mapper GMapping.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: GMappingConfig
    _particles: Particles

    def __init__(self, config: GMappingConfig | None = None, name: str = "gmapping") -> None:
        config = config or GMappingConfig()
        self._tables = beam_tables(config.beams, config.grid.cell)
        super().__init__(config, name, Particles(config.particles, config.grid))

    @property
    def _weight_gain(self) -> float:
        """Factor of the log-weights: weights are flatter with more particles.

        As in the program (`obsSigmaGain`); algorithm 1 of the paper has no such factor.
        """
        return 1.0 / self.config.particles

    def _move_and_weigh(
        self, scan: LaserScan, motion: Pose, deviations: Float64[np.ndarray, "3"]
    ) -> None:
        """Draw each particle's pose from motion and scan, and weigh it (lines 3 to 21)."""
        config, particles = self.config, self._particles
        points, _ = matched_points(scan, config.grid.reach, config.beams.spacing)
        search = Search(
            config.length_step,
            config.angle_step,
            config.iterations,
            config.samples,
            config.sample_step,
            config.sample_turn,
            config.least_score,
        )
        draw_poses(
            particles.pool.arrays,
            particles.index,
            particles.corner,
            config.grid.cell,
            points,
            motion,
            deviations,
            self._rng.standard_normal((particles.count, 3)),
            self._tables,
            search,
            particles.poses,
            particles.log_weights,
        )


@kernel(arrays=True, nogil=True)
def draw_poses(
    pool: PoolArrays,
    index: np.ndarray,
    corner: np.ndarray,
    cell: float,
    points: np.ndarray,
    motion: np.ndarray,
    deviations: np.ndarray,
    noise: np.ndarray,
    tables: BeamTables,
    search: Search,
    poses: np.ndarray,
    log_weights: np.ndarray,
) -> None:
    """Draw a pose of each particle, and add the log-likelihood of the scan to its log-weight.

    Args:
        pool: The tiles of the maps.
        index: The tiles of each map (particles, rows, columns).
        corner: Row and column of the first tile (see `Particles`).
        cell: Side of a cell (m).
        points: The ends of the beams (robot's frame, m).
        motion: The motion since the last update.
        deviations: Its standard deviations along the robot's axes (m, m, rad).
        noise: Standard normal random numbers (particles, 3).
        tables: The scores and log-likelihoods of one beam.
        search: Parameters of the search for the best pose.
        poses: The poses, changed in place.
        log_weights: The log-weights, changed in place.
    """
    scores, log_likelihoods = tables
    guess, best, trial, mean = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    covariance = np.empty((3, 3))
    samples = np.empty((search.samples**3, 4))
    for k in range(len(poses)):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        guess[0] = poses[k, 0] + cos * motion[0] - sin * motion[1]
        guess[1] = poses[k, 1] + sin * motion[0] + cos * motion[1]
        guess[2] = poses[k, 2] + motion[2]
        patch, low = cut_patch(pool, index[k], corner, cell, points, guess)
        score = _climb(patch, low, cell, points, guess, scores, search, best, trial)
        if score > search.least_score * len(points):
            log_weights[k] += _propose(
                patch, low, cell, points, guess, best, deviations, log_likelihoods, search,
                samples, mean, covariance,
            )  # fmt: skip
            # Sampled with the Cholesky factor of the covariance: lines 20 and 21.
            a = math.sqrt(covariance[0, 0])
            b, d = covariance[1, 0] / a, covariance[2, 0] / a
            c = math.sqrt(covariance[1, 1] - b * b)
            e = (covariance[2, 1] - b * d) / c
            f = math.sqrt(max(covariance[2, 2] - d * d - e * e, 0.0))
            u, v, w = noise[k, 0], noise[k, 1], noise[k, 2]
            poses[k, 0] = mean[0] + a * u
            poses[k, 1] = mean[1] + b * u + c * v
            poses[k, 2] = mean[2] + d * u + e * v + f * w
        else:
            # From the motion alone (lines 7 to 9). As in the paper, such a weight and that of a
            # matched particle have no common scale: line 19 sums over samples without their volume.
            cos, sin = math.cos(guess[2]), math.sin(guess[2])
            along, across = deviations[0] * noise[k, 0], deviations[1] * noise[k, 1]
            poses[k, 0] = guess[0] + cos * along - sin * across
            poses[k, 1] = guess[1] + sin * along + cos * across
            poses[k, 2] = guess[2] + deviations[2] * noise[k, 2]
            log_weights[k] += weigh_points(
                patch, low, cell, points, poses[k, 0], poses[k, 1], poses[k, 2], log_likelihoods
            )
        poses[k, 2] = wrap_angle(poses[k, 2])


@kernel()
def _climb(
    patch: np.ndarray,
    low: tuple[int, int],
    cell: float,
    points: np.ndarray,
    guess: np.ndarray,
    scores: np.ndarray,
    search: Search,
    best: np.ndarray,
    trial: np.ndarray,
) -> float:
    """Find the pose of the best fit by hill climbing from the guess (line 6); return its score."""
    for axis in range(3):
        best[axis] = guess[axis]
    score = weigh_points(patch, low, cell, points, best[0], best[1], best[2], scores)
    length, angle, halved = search.length_step, search.angle_step, 0
    while halved < search.iterations:
        cos, sin = length * math.cos(best[2]), length * math.sin(best[2])
        found, found_score = -1, score
        for move in range(6):
            _step(best, move, cos, sin, angle, trial)
            moved = weigh_points(patch, low, cell, points, trial[0], trial[1], trial[2], scores)
            if moved > found_score:
                found, found_score = move, moved
        if found < 0:
            length, angle, halved = 0.5 * length, 0.5 * angle, halved + 1
            continue
        _step(best, found, cos, sin, angle, trial)
        for axis in range(3):
            best[axis] = trial[axis]
        score = found_score
    return score


@kernel()
def _step(
    origin: np.ndarray, move: int, cos: float, sin: float, angle: float, trial: np.ndarray
) -> None:
    """Make one step from a pose: forward, back, left, right, or a turn to either side."""
    sign = 1.0 - 2.0 * (move % 2)
    for axis in range(3):
        trial[axis] = origin[axis]
    if move < 2:
        trial[0] += sign * cos
        trial[1] += sign * sin
    elif move < 4:
        trial[0] -= sign * sin
        trial[1] += sign * cos
    else:
        trial[2] += sign * angle


@kernel()
def _propose(
    patch: np.ndarray,
    low: tuple[int, int],
    cell: float,
    points: np.ndarray,
    guess: np.ndarray,
    best: np.ndarray,
    deviations: np.ndarray,
    log_likelihoods: np.ndarray,
    search: Search,
    samples: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
) -> float:
    """Fit mean and covariance of motion and scan together, by samples around the best pose.

    Lines 11 to 19. Returns the log-likelihood of the scan (line 21).
    """
    count = search.samples
    cos, sin = math.cos(guess[2]), math.sin(guess[2])
    most = -math.inf
    for n in range(count**3):
        x = best[0] + (n % count - 0.5 * (count - 1)) * search.sample_step
        y = best[1] + (n // count % count - 0.5 * (count - 1)) * search.sample_step
        heading = best[2] + (n // count**2 - 0.5 * (count - 1)) * search.sample_turn
        log = weigh_points(patch, low, cell, points, x, y, heading, log_likelihoods)
        along = (cos * (x - guess[0]) + sin * (y - guess[1])) / deviations[0]
        across = (cos * (y - guess[1]) - sin * (x - guess[0])) / deviations[1]
        turn = (heading - guess[2]) / deviations[2]
        log -= 0.5 * (along * along + across * across + turn * turn)
        samples[n, 0], samples[n, 1], samples[n, 2], samples[n, 3] = x, y, heading, log
        most = max(most, log)
    total = 0.0
    for axis in range(3):
        mean[axis] = 0.0
    for n in range(count**3):
        weight = math.exp(samples[n, 3] - most)
        samples[n, 3] = weight
        total += weight
        for axis in range(3):
            mean[axis] += weight * samples[n, axis]
    for axis in range(3):
        mean[axis] /= total
    for i in range(3):
        for j in range(3):
            summed = 0.0
            for n in range(count**3):
                summed += samples[n, 3] * (samples[n, i] - mean[i]) * (samples[n, j] - mean[j])
            covariance[i, j] = summed / total
        covariance[i, i] += 1e-12
    return most + math.log(total / count**3)
