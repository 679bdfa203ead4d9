"""Slightly disturbed copies of a log: how much a mapper's error on one real log is luck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from albot_core.geometry.poses import compose, relative
from albot_core.logs.log import Log

RANGE_NOISE = 0.005
"""Standard deviation (m) of what is added to every range, far below the laser's own."""
MOTION_NOISE = np.array([0.003, 0.003, np.radians(0.1)])
"""Standard deviations (m, m, rad) of what is added to every motion."""


def disturbed(log: Log, rng: np.random.Generator) -> Log:
    """The log with a little noise on every range and every motion."""
    ranges = np.abs(log.ranges + rng.normal(0.0, RANGE_NOISE, log.ranges.shape))
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions += rng.normal(size=motions.shape) * MOTION_NOISE
    odometry = [log.odometry[0]]
    for motion in motions:
        odometry.append(compose(odometry[-1], motion))
    return replace(log, ranges=ranges, odometry=np.array(odometry))
