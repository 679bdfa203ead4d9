"""The surfaces in an occupancy grid as line segments, for those who ask for lines."""

from __future__ import annotations

import contourpy
import numpy as np
import shapely

from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.maps.layers import MapSnapshot, OccupancyGridLayer

_LEVEL = 0.5
"""The border lies where a cell is as likely occupied as free."""


def surfaces_of(snapshot: MapSnapshot) -> Segments:
    """The surfaces of a map: its line segments, or else the outlines in its occupancy grid (m)."""
    grid = snapshot.layer(OccupancyGridLayer)
    if len(snapshot.segments) or grid is None:
        return snapshot.segments
    return outlines(grid)


def outlines(grid: OccupancyGridLayer, tolerance: float = 0.05, shortest: float = 0.2) -> Segments:
    """Where free ground ends at something, as line segments.

    They are the contours between cells that are believed to be free and those that are believed to
    be occupied (marching squares), straightened (D. Douglas and T. Peucker, Cartographica 10,
    1973). No line is drawn where the ground beyond is unknown.

    Args:
        grid: The grid.
        tolerance: No point of a contour is farther from its line than this (m).
        shortest: Contours that are shorter in all are left out (m).

    Returns:
        The segments (segments, 4), in the frame that the grid's origin is given in (m).
    """
    if min(grid.occupancy.shape) < 2:
        return np.empty((0, 4))
    known = np.ma.masked_invalid(grid.occupancy.astype(np.float64))
    # Without corners: a square of cells with an unknown one among them has no contour.
    contours = contourpy.contour_generator(z=known, corner_mask=False).lines(_LEVEL)
    found = [np.empty((0, 4))]
    for contour in contours:
        line = shapely.LineString((np.asarray(contour) + 0.5) * grid.resolution)
        if line.length >= shortest:
            points = shapely.get_coordinates(line.simplify(tolerance))
            found.append(np.concatenate((points[:-1], points[1:]), axis=1))
    return transform_segments(grid.origin, np.concatenate(found))
