"""FastSLAM with landmarks: particles, each with a Kalman filter for every landmark.

M. Montemerlo, S. Thrun, D. Koller and B. Wegbreit, FastSLAM, AAAI 2002, and FastSLAM 2.0, IJCAI
2003. Given the robot's path, landmarks are independent of each other, so a particle needs a small
filter for each and not a large one for all. Between updates the robot's motion is found by scan
matching, as in the FastSLAM that the thesis describes (section 2.2.1; Hähnel et al. 2003, which is
the mapper `grid-slam`).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.mappers.slam.fastslam_config import FastSlamConfig
from albot_core.mappers.slam.landmark_particles import LandmarkParticles, Landmarks
from albot_core.mappers.slam.particle_slam import ParticleSlam
from albot_core.sensing.reading import LaserScan, Reading


class FastSlam(ParticleSlam):
    """The mapper FastSLAM with landmarks.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: FastSlamConfig
    _particles: LandmarkParticles

    def __init__(self, config: FastSlamConfig | None = None, name: str = "fastslam") -> None:
        config = config or FastSlamConfig()
        super().__init__(config, name, LandmarkParticles(config))

    @property
    def landmarks(self) -> Landmarks:
        """The landmarks of the best particle."""
        return self._particles.landmarks_of(self._particles.best)

    @property
    def refused(self) -> int:
        """Number of landmarks, over all particles, for which there was no room (`landmarks`)."""
        return self._particles.refused

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its landmarks were entered into the maps.

        Raises:
            InputError: The reading lacks a laser scan, or its laser differs from earlier ones.
        """
        scan, scans = reading.required_laser(self._name), self._particles.scans
        if scans and scan.geometry != scans[0].geometry:
            raise InputError("Reading.laser", "the same laser at each reading", "another one")
        return super().update(reading)

    def _match(self, reading: Reading, scan: LaserScan) -> None:
        """Find the robot's motion, by scan matching or by the odometer."""
        if self.config.motion == "matched":
            super()._match(reading, scan)
        elif self._particles.updates:
            self._add_motion(reading.motion)

    @property
    def _weight_gain(self) -> float:
        """Factor of the log-weights."""
        return 1.0

    def _move_and_weigh(
        self, scan: LaserScan, motion: Pose, deviations: Float64[np.ndarray, "3"]
    ) -> None:
        """Draw a pose for each particle, and weigh it by the landmarks seen."""
        self._particles.look(scan)
        noise = self._rng.standard_normal((self._particles.count, 3))
        self._particles.move_and_weigh(motion, deviations, noise)
