"""A model of a laser's beams: where the point of a beam lies, and how precisely it fixes its wall.

Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

RANGE_NOISE = 0.01
"""Standard deviation of a range (m): the statistical error of a SICK LMS 200."""
WALL_NOISE = 0.002
"""Standard deviation of walls from a plane (m)."""
BEARING_NOISE = 0.15
"""Standard deviation of a point's bearing from the one that `nearer_side` gives, in widths of a
beam."""


class BeamModel(NamedTuple):
    """A model of a laser's beams."""

    spacing: float
    """Angle between neighbouring beams (rad)."""
    width: float
    """Full angle of a beam (rad); its range is that of the nearest surface in it; 0 for a ray."""
    is_used: bool
    """Whether points are placed and weighed by the model; see `ViewConfig.beam_model`."""


@kernel()
def nearer_side(ranges: np.ndarray, beam: int) -> float:
    """Return the side on which the wall hit by a beam is nearer: 1 left, -1 right, 0 neither.

    The wall is that of the neighbouring beam whose range differs less.
    """
    right = ranges[beam - 1] - ranges[beam] if beam > 0 else np.inf
    left = ranges[beam + 1] - ranges[beam] if beam + 1 < ranges.shape[0] else np.inf
    if abs(left) < abs(right):
        return float(-np.sign(left))
    return float(np.sign(right)) if abs(right) < np.inf else 0.0


@kernel()
def variance_across(square: float, aside: float, model: BeamModel) -> float:
    """Return the variance of a point across its wall, times `square`.

    The unit of the variance is that of a range, so it is about 1 where a beam hits a near wall at a
    right angle. `square` is the square of the point's distance from the laser (m²); the variance is
    multiplied by it to save divisions. `aside` is the distance of the wall's line from the laser
    (m). An error of the range moves the point across the wall by the sine of incidence, an error of
    the bearing by the cosine. So at grazing incidence a point of a thin beam is more precise than
    others, and a point of a wide beam less.
    """
    ahead = max(square - aside * aside, 0.0)
    bearing = (BEARING_NOISE * model.width / RANGE_NOISE) ** 2
    return float(aside * aside + square * ((WALL_NOISE / RANGE_NOISE) ** 2 + bearing * ahead))
