"""Opening a door in the wall that two rooms share."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.geometry.types import Points, Segments

DOOR_WIDTH = 0.9
"""Width (m) of a door where a plan states none."""

_STRAIGHT = 0.1
"""A wall that bends by less than this (m) is straight enough for a door."""
_NEAR = 0.15
"""Two outlines this close (m) are drawn along the same wall."""
_THICKEST_WALL = 0.6
"""Two outlines further apart than this (m) share no wall."""
_OVERCUT = 0.15
"""How far (m) a door is cut beyond the faces of its wall, which may bend by `_STRAIGHT`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Door:
    """An opening in a wall."""

    segment: Float64[np.ndarray, "4"]
    """The line across the opening x1, y1, x2, y2 (m)."""
    opening: shapely.Polygon
    """What is cut out of the walls."""
    jambs: Segments
    """The sides of the opening where the two rooms' walls lie apart; else empty."""


def find_door(
    first: shapely.Polygon, second: shapely.Polygon, near: shapely.Point | None
) -> Door | None:
    """The door between two rooms, as near as it can be to a point of their wall.

    It keeps inside one straight stretch along which the rooms touch, so that it cuts no
    other wall; a stretch narrower than a door is opened whole.

    Args:
        first: One room's outline (m).
        second: The other's.
        near: Where the door should be; None takes the middle of the longest stretch.

    Returns:
        The door; None where the rooms do not touch.
    """
    stretches = _shared(first, second, reach=first.distance(second) + _NEAR)
    wide = [stretch for stretch in stretches if stretch.length >= DOOR_WIDTH]
    if not stretches or first.distance(second) > _THICKEST_WALL:
        return None
    longest = max(stretches, key=lambda stretch: float(stretch.length))
    if near is None or not wide:
        return _cut(longest, longest.length / 2, second)
    nearest = min(wide, key=lambda stretch: float(stretch.distance(near)))
    return _cut(nearest, nearest.project(near), second)


def _shared(
    first: shapely.Polygon, second: shapely.Polygon, reach: float
) -> list[shapely.LineString]:
    """The straight stretches of the first outline that run within reach of the second."""
    corners = np.array(shapely.simplify(first.exterior, _STRAIGHT).coords)
    nearby = shapely.buffer(second.exterior, reach, cap_style="flat")
    sides = [shapely.LineString(side) for side in pairwise(corners)]
    parts = shapely.get_parts([side.intersection(nearby) for side in sides])
    return [part for part in parts if part.geom_type == "LineString" and part.length > reach]


def _cut(stretch: shapely.LineString, along: float, second: shapely.Polygon) -> Door:
    """The door in a straight stretch, its middle at a length along it where there is room."""
    half = min(DOOR_WIDTH, stretch.length) / 2
    start, end = np.array(stretch.coords)
    direction = (end - start) / stretch.length
    middle = start + direction * np.clip(along, half, stretch.length - half)
    other_face = shapely.shortest_line(shapely.Point(middle), second.exterior)
    normal = np.array([-direction[1], direction[0]])
    depth = float(normal @ np.subtract(other_face.coords[1], other_face.coords[0]))
    sides = middle + np.outer([-half, half], direction)
    if depth < 0:
        normal, depth = -normal, -depth
    return Door(
        segment=(sides + normal * depth / 2).reshape(4),
        opening=_rectangle(sides - normal * _OVERCUT, normal * (depth + 2 * _OVERCUT)),
        jambs=np.concatenate((sides, sides + normal * depth), axis=1)[
            : 2 if depth > _OVERCUT else 0
        ],
    )


def _rectangle(side: Points, across: Float64[np.ndarray, "2"]) -> shapely.Polygon:
    return shapely.Polygon([*side, *(side[::-1] + across)])
