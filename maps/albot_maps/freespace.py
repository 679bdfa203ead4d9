"""Free space: where a disc of the robot's size fits, and its connected regions."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.geometry.types import Segments

MARGIN = 4
"""Free space reaches this many radii of the disc beyond the rectangle around all walls."""


def wall_lines(walls: Segments) -> shapely.MultiLineString:
    """Return the walls as one shape, for distances and unions."""
    return shapely.multilinestrings(shapely.linestrings(walls.reshape(-1, 2, 2)))


def floor_at(walls: Segments, point: Float64[np.ndarray, "2"]) -> shapely.Polygon:
    """Return all points near the building that no walls separate from a point (m) on no wall.

    So the inside of furniture, and a chamber without a door, are no part of the floor of a room.
    """
    lines = wall_lines(walls)
    frame = shapely.box(*lines.bounds).buffer(1.0, join_style="mitre").exterior
    parts = shapely.get_parts(shapely.polygonize([shapely.union_all([lines, frame])]))
    here = shapely.Point(point)
    return min(parts, key=lambda part: float(part.distance(here)))


def _without_crossed_rings(chains: np.ndarray) -> np.ndarray:
    """Return the lines with closed ones that cross themselves cut in two.

    GEOS widens a closed line as a ring, and leaves parts of one that crosses itself out.
    """
    crossed = shapely.is_closed(chains) & ~shapely.is_simple(chains)
    halves = []
    for chain in chains[crossed]:
        corners = np.array(chain.coords)
        middle = len(corners) // 2
        halves += [shapely.LineString(corners[: middle + 1]), shapely.LineString(corners[middle:])]
    return np.concatenate((chains[~crossed], np.array(halves, object)))


def widest_place(region: shapely.Polygon) -> Float64[np.ndarray, "2"]:
    """Return the centre of the largest disc in a region, in whole centimetres where there is room.

    The disc's radius is within 5 cm of the largest.
    """
    centre = np.array(shapely.maximum_inscribed_circle(region, tolerance=0.05).coords[0])
    rounded = np.round(centre, 2)
    return rounded if region.covers(shapely.Point(rounded)) else centre


class FreeSpace:
    """The points at which the centre of a disc of `radius` (m) can be without touching a wall.

    It is the plane near the building minus the walls widened by the radius. Round ends are
    polygons inscribed in the true circle. The error is about 1 % of the radius at most, and it
    makes free space larger.

    Args:
        walls: Everything the disc must not touch.
        radius: The disc's radius (m).
    """

    _SIDES_PER_QUARTER = 8

    def __init__(self, walls: Segments, radius: float) -> None:
        self.radius = radius
        lines = wall_lines(walls)
        # Widening chain by chain before the union is far faster than widening all walls at once.
        chains = _without_crossed_rings(shapely.get_parts(shapely.line_merge(lines)))
        widened = shapely.buffer(chains, radius, quad_segs=self._SIDES_PER_QUARTER)
        self._widened = shapely.union_all(widened)
        x_min, y_min, x_max, y_max = lines.bounds
        margin = MARGIN * radius
        self._frame = shapely.box(x_min - margin, y_min - margin, x_max + margin, y_max + margin)
        self._lines = lines
        self.hull: shapely.Geometry = lines.convex_hull
        """The convex hull of the walls."""

    @property
    def rectangle(self) -> shapely.Polygon:
        """The rectangle around all walls with its margin, as far as free space reaches."""
        return self._frame

    @cached_property
    def regions(self) -> tuple[shapely.Polygon, ...]:
        """The connected regions, including the one outside the building."""
        free = shapely.get_parts(shapely.difference(self._frame, self._widened))
        shapely.prepare(free)
        return tuple(free)

    def is_clear(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Return whether the disc touches no wall at a point (m): exactly, unlike the regions."""
        return self.clearance(point) >= self.radius

    def clearance(self, point: Float64[np.ndarray, "2"]) -> float:
        """Return the distance (m) from a point to the nearest wall."""
        return float(self._lines.distance(shapely.Point(point)))

    def region_at(self, point: Float64[np.ndarray, "2"]) -> shapely.Polygon:
        """Return the region that contains a free point (m)."""
        here = shapely.Point(point)
        return min(self.regions, key=lambda region: float(region.distance(here)))

    def is_enclosed(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Return whether walls prevent the disc from leaving the building from `point` (m)."""
        return self.encloses(self.region_at(point))

    def encloses(self, region: shapely.Polygon) -> bool:
        """Return whether walls separate one of the regions from the outside of the building."""
        return not region.intersects(self._frame.exterior)

    def disc_fits_inside(self, region: shapely.Polygon, outline: shapely.Polygon) -> bool:
        """Return whether the disc, moving within `region`, can lie completely inside `outline`."""
        # Inscribed like the widened walls; otherwise a room exactly as wide as the robot is lost.
        inside = shapely.buffer(outline, -self.radius, quad_segs=self._SIDES_PER_QUARTER)
        return bool(region.intersects(inside))
