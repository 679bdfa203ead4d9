"""Grid-based FastSLAM: particles that move by scan matching, each with its own grid map.

D. Hähnel, W. Burgard, D. Fox and S. Thrun, An efficient FastSLAM algorithm for generating maps of
large-scale cyclic environments from raw laser range measurements, IROS 2003. Scan matching leaves
so little drift that few particles are enough to contain the true path when a loop is closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import wrap_angle
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.beam_model import BeamConfig, beam_tables, cut_patch, weigh_points
from albot_core.mappers.slam.particle_slam import ParticleSlam, ParticleSlamConfig
from albot_core.mappers.slam.particles import Particles
from albot_core.mappers.slam.tiles import PoolArrays
from albot_core.matching.scan_points import matched_points
from albot_core.sensing.reading import LaserScan


@dataclass(frozen=True, kw_only=True)
class GridSlamConfig(ParticleSlamConfig):
    """Parameters of grid-based FastSLAM.

    The paper learns the error of scan matching from data. These values were tuned on the Intel log.
    """

    particles: int = 100
    """Number of particles, as in the paper; 100,000 at most."""
    drift: float = 0.015
    """Standard deviation of the matched position per distance (m/m)."""
    drift_by_turn: float = 0.01
    """Standard deviation of the matched position per turn (m/rad)."""
    twist: float = 0.01
    """Standard deviation of the matched heading per turn (rad/rad)."""
    twist_by_way: float = 0.005
    """Standard deviation of the matched heading per distance (rad/m)."""
    beams: BeamConfig = field(default_factory=lambda: BeamConfig(gain=15.0))
    """Comparison of scans with maps. The paper does not state its beam model; this is the model of
    GMapping, by the same authors, with beams that depend more on each other. The gain was tuned on
    Intel: poses that are sampled blindly err more than a proposal's, so a weight must say less
    (docs/slam.md)."""


class GridSlam(ParticleSlam):
    """The mapper grid-based FastSLAM.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: GridSlamConfig
    _particles: Particles

    def __init__(self, config: GridSlamConfig | None = None, name: str = "grid-slam") -> None:
        config = config or GridSlamConfig()
        self._log_likelihoods = beam_tables(config.beams, config.grid.cell).log_likelihoods
        super().__init__(config, name, Particles(config.particles, config.grid))

    @property
    def _weight_gain(self) -> float:
        """Factor of the log-weights."""
        return 1.0

    def _move_and_weigh(
        self, scan: LaserScan, motion: Pose, deviations: Float64[np.ndarray, "3"]
    ) -> None:
        """Sample the motion of each particle, and weigh it by the scan in its own map."""
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
    """Move each particle, and add the log-likelihood of the scan to its log-weight.

    Args:
        pool: The tiles of the maps.
        index: The tiles of each map (particles, rows, columns).
        corner: Row and column of the first tile (see `Particles`).
        cell: Side of a cell (m).
        points: The ends of the beams (robot's frame, m).
        motion: The motion since the last update, by scan matching.
        errors: The sampled error of each particle, along the robot's axes (particles, 3).
        log_likelihoods: See `beam_tables`.
        poses: The poses, changed in place.
        log_weights: The log-weights, changed in place.
    """
    for k in range(len(poses)):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        x = poses[k, 0] + cos * motion[0] - sin * motion[1]
        y = poses[k, 1] + sin * motion[0] + cos * motion[1]
        heading = poses[k, 2] + motion[2]
        cos, sin = math.cos(heading), math.sin(heading)
        poses[k, 0] = x + cos * errors[k, 0] - sin * errors[k, 1]
        poses[k, 1] = y + sin * errors[k, 0] + cos * errors[k, 1]
        poses[k, 2] = wrap_angle(heading + errors[k, 2])
        patch, low = cut_patch(pool, index[k], corner, cell, points, poses[k])
        log_weights[k] += weigh_points(
            patch, low, cell, points, poses[k, 0], poses[k, 1], poses[k, 2], log_likelihoods
        )
