"""Grid-based FastSLAM: particles that move by matched scans, each with a grid map of its own.

D. Hähnel, W. Burgard, D. Fox and S. Thrun, An efficient FastSLAM algorithm for generating maps of
large-scale cyclic environments from raw laser range measurements, IROS 2003. Matching scans with
the latest ones leaves so little error that few particles hold the truth when a loop is closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.beam_model import BeamConfig, beam_tables, cut_patch, weigh_points
from albot_core.mappers.slam.particle_slam import ParticleSlam, ParticleSlamConfig
from albot_core.mappers.slam.points import matched_points
from albot_core.mappers.slam.tiles import PoolArrays
from albot_core.sensing.reading import LaserScan


@dataclass(frozen=True, kw_only=True)
class GridSlamConfig(ParticleSlamConfig):
    """Thresholds of grid-based FastSLAM.

    The paper learns the errors of matched scans from data: ours were chosen on the Intel log.
    """

    particles: int = 100
    """How many particles, as the paper's."""
    drift: float = 0.015
    """Standard deviation of the matched position for each metre gone…"""
    drift_by_turn: float = 0.01
    """…and for each radian turned (m/rad)."""
    twist: float = 0.01
    """Standard deviation of the matched heading for each radian turned…"""
    twist_by_way: float = 0.005
    """…and for each metre gone (rad/m)."""
    beams: BeamConfig = field(default_factory=lambda: BeamConfig(gain=5.0))
    """How scans are compared with maps. The paper's model of beams is not given; this is GMapping's
    of the same authors, in which beams depend more on each other."""


class GridSlam(ParticleSlam):
    """Grid-based FastSLAM.

    Args:
        config: All thresholds.
        name: The name under which the mapper is known.
    """

    config: GridSlamConfig

    def __init__(self, config: GridSlamConfig | None = None, name: str = "grid-slam") -> None:
        config = config or GridSlamConfig()
        _, self._log_likelihoods = beam_tables(config.beams, config.grid.cell)
        super().__init__(config, name)

    @property
    def _weight_gain(self) -> float:
        """Weights are what they are."""
        return 1.0

    def _move_and_weigh(
        self, scan: LaserScan, motion: Pose, deviations: Float64[np.ndarray, "3"]
    ) -> None:
        """Draw the motion of each particle, and weigh it by the scan in its own map."""
        config, particles = self.config, self._particles
        points, _ = matched_points(scan, config.grid.reach, config.beams.spacing)
        move_and_weigh(
            particles.pool.arrays,
            particles.index,
            particles.corner,
            config.grid.cell,
            points,
            motion,
            deviations * self._rng.standard_normal((particles.count, 3)),
            self._log_likelihoods,
            particles.poses,
            particles.log_weights,
        )


@kernel(arrays=True, nogil=True)
def move_and_weigh(
    pool: PoolArrays,
    index: np.ndarray,
    corner: np.ndarray,
    cell: float,
    points: np.ndarray,
    motion: np.ndarray,
    errors: np.ndarray,
    log_likelihoods: np.ndarray,
    poses: np.ndarray,
    log_weights: np.ndarray,
) -> None:
    """Move each particle, and add the logarithm of how likely the scan is to its weight.

    Args:
        pool: The tiles of the maps.
        index: The tiles of each map (particles, rows, columns).
        corner: Where they begin (see `Particles`).
        cell: Side of a cell (m).
        points: Where beams ended (robot's frame, m).
        motion: The motion since the last update, as the scans were matched.
        errors: Those drawn for each particle, along the robot's axes (particles, 3).
        log_likelihoods: See `beam_tables`.
        poses: The poses, changed in place.
        log_weights: The weights, changed in place.
    """
    for k in range(len(poses)):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        x = poses[k, 0] + cos * motion[0] - sin * motion[1]
        y = poses[k, 1] + sin * motion[0] + cos * motion[1]
        heading = poses[k, 2] + motion[2]
        cos, sin = math.cos(heading), math.sin(heading)
        poses[k, 0] = x + cos * errors[k, 0] - sin * errors[k, 1]
        poses[k, 1] = y + sin * errors[k, 0] + cos * errors[k, 1]
        poses[k, 2] = (heading + errors[k, 2] + math.pi) % (2.0 * math.pi) - math.pi
        patch, low = cut_patch(pool, index[k], corner, cell, points, poses[k])
        log_weights[k] += weigh_points(
            patch, low, cell, points, poses[k, 0], poses[k, 1], poses[k, 2], log_likelihoods
        )
