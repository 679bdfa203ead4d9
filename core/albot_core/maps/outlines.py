"""The surfaces in an occupancy grid as line segments, for uses that need lines."""

from __future__ import annotations

import contourpy
import numpy as np
import shapely

from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.maps.layers import MapSnapshot, OccupancyGridLayer

_LEVEL = 0.5
"""Occupancy at the contours: a cell there is equally likely occupied and free."""


def surfaces_of(snapshot: MapSnapshot) -> Segments:
    """Return a map's line segments, or if it has none the outlines in its occupancy grid (m)."""
    grid = snapshot.layer(OccupancyGridLayer)
    if len(snapshot.segments) or grid is None:
        return snapshot.segments
    return outlines(grid)


def outlines(grid: OccupancyGridLayer, tolerance: float = 0.05, shortest: float = 0.2) -> Segments:
    """Return the borders between free and occupied cells, as line segments.

    They are the contours between free and occupied cells (marching squares), simplified (D. Douglas
    and T. Peucker, Cartographica 10, 1973). Borders of unknown cells have no lines.

    Args:
        grid: The grid.
        tolerance: Largest distance of a contour's point from its line (m).
        shortest: Smallest total length of a contour (m); shorter ones are left out.

    Returns:
        The segments (segments, 4), in the frame of the grid's origin (m).
    """
    if min(grid.occupancy.shape) < 2:
        return np.empty((0, 4))
    known = np.ma.masked_invalid(grid.occupancy.astype(np.float64))
    # No corner masks: four neighbouring cells with an unknown one among them have no contour.
    contours = contourpy.contour_generator(z=known, corner_mask=False).lines(_LEVEL)
    found = [np.empty((0, 4))]
    for contour in contours:
        line = shapely.LineString((np.asarray(contour) + 0.5) * grid.resolution)
        if line.length >= shortest:
            points = shapely.get_coordinates(line.simplify(tolerance))
            found.append(np.concatenate((points[:-1], points[1:]), axis=1))
    return transform_segments(grid.origin, np.concatenate(found))
