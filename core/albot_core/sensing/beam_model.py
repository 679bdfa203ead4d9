"""What is known of a laser's beams: where a point lies, and how precisely it tells of its wall.

Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

RANGE_NOISE = 0.01
"""Standard deviation of a range (m): the statistical error of a SICK LMS 200."""
WALL_NOISE = 0.002
"""How uneven walls are (m, standard deviation)."""
BEARING_NOISE = 0.15
"""Standard deviation of a point's bearing about where `nearer_side` puts it, in widths of a
beam."""


class BeamModel(NamedTuple):
    """What is known of a laser's beams."""

    spacing: float
    """Angle between neighbouring beams (rad)."""
    width: float
    """Full angle of a beam (rad), which measures the nearest of what it meets; 0 for a ray."""
    is_used: bool
    """Whether points are placed and weighed by it; see `ViewConfig.beam_model`."""


@kernel()
def nearer_side(ranges: np.ndarray, beam: int) -> float:
    """Return to which side the wall that a beam meets comes nearer: 1 left, -1 right, 0 neither.

    The wall is that of the neighbouring beam whose range differs less.
    """
    right = ranges[beam - 1] - ranges[beam] if beam > 0 else np.inf
    left = ranges[beam + 1] - ranges[beam] if beam + 1 < ranges.shape[0] else np.inf
    if abs(left) < abs(right):
        return float(-np.sign(left))
    return float(np.sign(right)) if abs(right) < np.inf else 0.0


@kernel()
def variance_across(square: float, aside: float, model: BeamModel) -> float:
    """How imprecisely a point tells where its wall is: its variance across it, times `square`.

    The variance is in that of a range, so it is about 1 where a near wall is met head on. `square`
    is the square of the point's distance from the laser (m²), with which the variance is
    multiplied to save divisions; the wall's line passes the laser `aside` (m). An error of the
    range moves the point across the wall by its sine of incidence, one of the bearing by the
    cosine. So a point that a thin beam meets at a grazing angle tells more than another, and one
    that a wide beam meets so tells less.
    """
    ahead = max(square - aside * aside, 0.0)
    bearing = (BEARING_NOISE * model.width / RANGE_NOISE) ** 2
    return float(aside * aside + square * ((WALL_NOISE / RANGE_NOISE) ** 2 + bearing * ahead))
