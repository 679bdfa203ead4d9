"""The laser: a SICK LMS-200-like scanner whose ranges are noisy and sometimes missing."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Ranges
from albot_core.perception.reading import LaserGeometry, LaserScan


@dataclass(frozen=True, kw_only=True)
class LaserConfig:
    """The laser's beams and errors.

    One centimetre of noise stands for all errors of a LMS-200's ranges; the rate of
    drop-outs is ours.
    """

    geometry: LaserGeometry = field(default_factory=LaserGeometry)
    """Where the beams point, how far they reach, and where the laser sits."""
    range_noise: float = 0.01
    """Standard deviation of a range (m)."""
    dropout: float = 0.001
    """Probability that a beam which meets a wall brings nothing back."""

    def __post_init__(self) -> None:
        if not 0 <= self.range_noise < np.inf:
            raise InputError("LaserConfig.range_noise", "at least 0", str(self.range_noise))
        if not 0 <= self.dropout <= 1:
            raise InputError("LaserConfig.dropout", "within [0, 1]", str(self.dropout))


LMS_200 = LaserConfig()
"""The papers' laser."""


class Laser:
    """Makes the scan that the laser reports out of the true ranges."""

    def __init__(self, config: LaserConfig) -> None:
        self.config = config

    def sense(self, true_ranges: Ranges, rng: np.random.Generator) -> LaserScan:
        """The scan reported where the walls are at `true_ranges` (m, infinite for none).

        It draws as many random numbers whatever the ranges are.
        """
        config = self.config
        ranges = true_ranges + config.range_noise * rng.standard_normal(len(true_ranges))
        np.maximum(ranges, 0.0, out=ranges)
        missing = rng.random(len(ranges)) < config.dropout
        ranges[missing | (ranges >= config.geometry.max_range)] = np.inf
        return LaserScan(ranges=ranges, geometry=config.geometry)
