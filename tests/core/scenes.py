"""Tiny hand-drawn scenes, scanned by the slow obvious method."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import inverse, transform_segments
from albot_core.perception.reading import LaserGeometry, LaserScan

ROOM = np.array(
    [
        [-4.0, -3.0, 5.0, -3.0],
        [5.0, -3.0, 5.0, 4.0],
        [5.0, 4.0, -4.0, 4.0],
        [-4.0, 4.0, -4.0, -3.0],
        # A cupboard, and a pillar standing free.
        [2.0, 4.0, 2.0, 3.2],
        [2.0, 3.2, 3.5, 3.2],
        [3.5, 3.2, 3.5, 4.0],
        [2.6, -1.0, 3.4, -1.0],
        [3.4, -1.0, 3.4, -1.8],
        [3.4, -1.8, 2.6, -1.8],
        [2.6, -1.8, 2.6, -1.0],
    ]
)
"""A room of 9 x 7 m with a cupboard in its far wall and a pillar (m)."""


def scan_from(
    pose: np.ndarray, walls: np.ndarray, geometry: LaserGeometry | None = None
) -> LaserScan:
    """The exact scan of the walls from a pose, beam by beam and wall by wall."""
    geometry = geometry or LaserGeometry()
    seen = transform_segments(inverse(pose), walls)
    ranges = np.full(geometry.beams, np.inf)
    for i, (dx, dy) in enumerate(geometry.directions):
        for x1, y1, x2, y2 in seen:
            wx, wy = x2 - x1, y2 - y1
            cross = dx * wy - dy * wx
            if abs(cross) < 1e-12:
                continue
            reach = (x1 * wy - y1 * wx) / cross
            along = (x1 * dy - y1 * dx) / cross
            if reach > 0 and -1e-9 <= along <= 1 + 1e-9:
                ranges[i] = min(ranges[i], reach)
    ranges[ranges >= geometry.max_range] = np.inf
    return LaserScan(ranges=ranges, geometry=geometry)
