"""Landmarks in a laser scan: the corners and the free ends of walls.

FastSLAM's landmarks are points that are met again from elsewhere. In a building these are the
corners at which two walls meet, and the ends of walls that occlude what lies behind them. Both are
found in the view (thesis, section 3.1.3). Which points are landmarks, and how precisely each is
known, is ours: Montemerlo's landmarks are the trunks of trees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields
from albot_core.sensing.reading import LaserScan
from albot_core.sensing.view import (
    CORNER,
    OCCLUDING,
    ViewBuffers,
    ViewConfig,
    ViewSettings,
    extract_surfaces,
    make_view_buffers,
    view_settings,
)

_LEAST_SINE = 0.1
"""Sine of the flattest incidence of a beam on a wall; flatter beams count as this."""
_TINY = 1e-9
"""Distance of a point that lies at the laser (m)."""


@dataclass(frozen=True, kw_only=True)
class LineEndConfig:
    """Which ends of walls are landmarks, and how precisely they are seen. All values are ours."""

    view: ViewConfig = field(
        default_factory=lambda: ViewConfig(
            fit_lines=True,
            min_incidence=math.radians(10.0),
            cut_ends=True,
            beam_model=True,
            surface_points=5,
        )
    )
    """Construction of the walls."""
    reach: float = 12.0
    """Largest distance of a landmark from the laser (m)."""
    least_length: float = 0.4
    """Shortest wall whose ends are landmarks (m)."""
    least_angle: float = math.radians(30.0)
    """Smallest angle between the two walls of a corner (rad)."""
    noise: float = 0.05
    """Standard deviation of a landmark along each axis (m)."""
    bearing_noise: float = math.radians(0.3)
    """Standard deviation of its bearing (rad), which adds to `noise`."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "reach", "least_length", "noise")
        check_fields(self, NOT_NEGATIVE, "least_angle", "bearing_noise")


SeenLandmarks = Float64[np.ndarray, "landmarks 5"]
"""Landmarks seen at a moment: x, y (m) in the robot's frame, and the covariance of their error:
xx, xy, yy (m²)."""


def find_line_ends(scan: LaserScan, config: LineEndConfig) -> SeenLandmarks:
    """Return the corners and free ends of walls in a scan, in the order of the beams."""
    beams = scan.geometry.beams
    settings = view_settings(scan.geometry, config.view)
    found = np.empty((2 * beams, 5))
    count = _find(
        scan.ranges,
        settings,
        make_view_buffers(beams),
        np.empty((beams, 4)),
        np.empty((beams, 2), np.int8),
        (config.reach, config.least_length, math.sin(config.least_angle)),
        (config.noise, config.bearing_noise, scan.geometry.spacing),
        found,
    )
    return found[:count].copy()


@kernel()
def _find(
    ranges: np.ndarray,
    settings: ViewSettings,
    buffers: ViewBuffers,
    surfaces: np.ndarray,
    edges: np.ndarray,
    limits: tuple[float, float, float],
    noises: tuple[float, float, float],
    found: np.ndarray,
) -> int:
    """Write the landmarks of a scan to `found`; return how many.

    Args:
        ranges: Range of every beam (m), (beams,).
        settings: The laser, and the parameters of view construction.
        buffers: Scratch buffers.
        surfaces: Scratch buffer (beams, 4).
        edges: Scratch buffer (beams, 2), int8.
        limits: Reach (m), shortest wall (m), and sine of the smallest angle of a corner.
        noises: Noise (m), noise of the bearing (rad), and angle between beams (rad).
        found: The landmarks, see `SeenLandmarks` (2 beams, 5); written over.
    """
    reach, shortest, least_sine = limits
    walls = extract_surfaces(ranges, settings, buffers, surfaces, edges)
    count, before = 0, 0.0
    for k in range(walls):
        ux, uy = surfaces[k, 2] - surfaces[k, 0], surfaces[k, 3] - surfaces[k, 1]
        length = math.sqrt(ux * ux + uy * uy)
        if length < shortest:
            before = 0.0
            continue
        ux, uy = ux / length, uy / length
        for end in range(2):
            x, y = surfaces[k, 2 * end], surfaces[k, 2 * end + 1]
            dx, dy = x - settings.mount[0], y - settings.mount[1]
            if dx * dx + dy * dy > reach * reach:
                continue
            if edges[k, end] == OCCLUDING:
                sign = 2.0 * end - 1.0
                _write_end(x, y, sign * ux, sign * uy, dx, dy, noises, found[count])
                count += 1
            elif edges[k, end] == CORNER and end == 0 and before > 0.0:
                # The corner ends the wall before this one, too.
                vx = surfaces[k - 1, 2] - surfaces[k - 1, 0]
                vy = surfaces[k - 1, 3] - surfaces[k - 1, 1]
                if abs(ux * vy - uy * vx) >= least_sine * before:
                    _write_point(x, y, dx, dy, noises, found[count])
                    count += 1
        before = length
    return count


@kernel()
def _write_point(
    x: float,
    y: float,
    dx: float,
    dy: float,
    noises: tuple[float, float, float],
    row: np.ndarray,
) -> None:
    """Write a landmark at x, y, which lies (dx, dy) from the laser."""
    even, across = noises[0] * noises[0], noises[1] * noises[1]
    row[0], row[1] = x, y
    # An error of the bearing moves the point across the beam: by (-dy, dx) for each radian.
    row[2] = even + across * dy * dy
    row[3] = -across * dx * dy
    row[4] = even + across * dx * dx


@kernel()
def _write_end(
    x: float,
    y: float,
    ux: float,
    uy: float,
    dx: float,
    dy: float,
    noises: tuple[float, float, float],
    row: np.ndarray,
) -> None:
    """Write the free end of a wall whose last point is x, y; (ux, uy) leads outwards along it.

    The wall ends between its last beam and the next, anywhere along that gap: so the landmark lies
    in the middle of it, with the variance of a uniform distribution.
    """
    distance = math.sqrt(dx * dx + dy * dy)
    sine = abs(ux * dy - uy * dx) / max(distance, _TINY)
    gap = distance * noises[2] / max(sine, _LEAST_SINE)
    _write_point(x + 0.5 * gap * ux, y + 0.5 * gap * uy, dx, dy, noises, row)
    spread = gap * gap / 12.0
    row[2] += spread * ux * ux
    row[3] += spread * ux * uy
    row[4] += spread * uy * uy
