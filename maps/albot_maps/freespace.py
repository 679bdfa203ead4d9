"""Free space: where a disc of the robot's size can be, and which parts hang together."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.geometry.types import Segments


def wall_lines(walls: Segments) -> shapely.MultiLineString:
    """The walls as one shape, for distances and unions."""
    return shapely.multilinestrings(shapely.linestrings(walls.reshape(-1, 2, 2)))


class FreeSpace:
    """The points where the middle of a disc of `radius` (m) touches no wall.

    It is the plane near the building less the walls widened by the radius. Round ends
    are drawn as polygons inscribed in the true circle, which errs by at most 0.5 % of the
    radius and to the robot's favour.

    Args:
        walls: Everything the disc must not touch.
        radius: Its radius (m).
    """

    _SIDES_PER_QUARTER = 8

    def __init__(self, walls: Segments, radius: float) -> None:
        self.radius = radius
        lines = wall_lines(walls)
        # Widened chain by chain and then united: far faster than the whole at once.
        chains = shapely.get_parts(shapely.line_merge(lines))
        widened = shapely.buffer(chains, radius, quad_segs=self._SIDES_PER_QUARTER)
        self._widened = shapely.union_all(widened)
        x_min, y_min, x_max, y_max = lines.bounds
        margin = 4 * radius
        self._frame = shapely.box(x_min - margin, y_min - margin, x_max + margin, y_max + margin)

    @cached_property
    def regions(self) -> tuple[shapely.Polygon, ...]:
        """The parts that hang together, the one outside the building included."""
        free = shapely.get_parts(shapely.difference(self._frame, self._widened))
        shapely.prepare(free)
        return tuple(free)

    def region_at(self, point: Float64[np.ndarray, "2"]) -> shapely.Polygon:
        """The region that holds a free point (m)."""
        here = shapely.Point(point)
        return min(self.regions, key=lambda region: float(region.distance(here)))

    def is_enclosed(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Whether the walls keep the disc from leaving the building from `point` (m)."""
        return self.encloses(self.region_at(point))

    def encloses(self, region: shapely.Polygon) -> bool:
        """Whether walls bar the way from one of the regions out of the building."""
        return not region.intersects(self._frame.exterior)

    def enters(self, region: shapely.Polygon, outline: shapely.Polygon) -> bool:
        """Whether the disc, moving about in `region`, can stand wholly inside `outline`."""
        # Inscribed like the widened walls: else a room exactly as wide as the robot is lost.
        inside = shapely.buffer(outline, -self.radius, quad_segs=self._SIDES_PER_QUARTER)
        return bool(region.intersects(inside))
