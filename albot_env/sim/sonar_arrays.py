"""The sonars as arrays and numbers, as compiled code takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Sonars(NamedTuple):
    """What the compiled sonars compute with; see `SonarConfig.constants`."""

    mounts: np.ndarray
    """(sonars, 4) float64: x, y (m), cosine and sine of the bearing, robot's frame."""
    horizon: float
    """Distance (m) from the robot's middle beyond which no sonar hears."""
    behind: float
    """Nothing with both ends at x below this (m), robot's frame, is in any sonar's cone."""
    slope: float
    """Tangent of half the cone."""
    min_range: float
    """Nearer echoes are reported as this (m)."""
    max_range: float
    """Farther echoes are not heard (m)."""
    cos_limit: float
    """Cosine and sine of the specular limit."""
    sin_limit: float
    corner_reach: float
    """Distance (m) up to which concave corners echo."""
    edge_reach: float
    """Distance (m) up to which edges and wall ends echo."""
    noise: float
    """Standard deviation of a range (m)."""
    proportional_noise: float
    """Standard deviation of a range as a share of it."""
    crosstalk: int
    """Probability of hearing a neighbour's pulse, times 2^25."""
    dropout: int
    """Probability of missing an echo, times 2^26."""
    normals: np.ndarray
    """(4096,) float64: normal numbers of deviation 1, each as likely as the others."""
