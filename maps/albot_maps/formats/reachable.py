"""Complete a plan that states no start: choose one, and find the rooms that a robot can reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_maps.freespace import FreeSpace, widest_place
from albot_maps.world import LARGEST_COORDINATE, METRES, Exit, Room, World


def reachable_world(
    *,
    name: str,
    walls: Segments,
    rooms: tuple[Room, ...],
    exits: tuple[Exit, ...],
    notes: tuple[str, ...],
    source: str,
    robot_radius: float,
) -> World:
    """Return the world of a plan that states no start, for a robot of this radius (m).

    The start is the centre of the widest place in the largest connected part of the rooms. Rooms
    that the robot cannot reach from there keep their walls, but they and their exits are left
    out, and a note names them.

    Raises:
        InputError: A wall is beyond `LARGEST_COORDINATE`, or the robot fits in no room.
    """
    check_coordinates(walls, source)
    space = FreeSpace(walls, robot_radius)
    outlines = [shapely.Polygon(room.boundary) for room in rooms]
    start, region = _start(space, shapely.unary_union(outlines), source)
    reached = {
        room.name
        for room, outline in zip(rooms, outlines, strict=True)
        if space.disc_fits_inside(region, outline)
    }
    shut = [room.name for room in rooms if room.name not in reached]
    if shut:
        notes = (*notes, f"walls only, because no robot fits in: {', '.join(shut)}")
    return World(
        name=name,
        walls=walls,
        starts=start.reshape(1, 3),
        rooms=tuple(room for room in rooms if room.name in reached),
        exits=tuple(opening for opening in exits if reached.issuperset(opening.rooms)),
        notes=notes,
        source=source,
        robot_radius=robot_radius,
    )


LEAST_SHARE = 0.1
"""Ground within walls is preferred if its area is at least this share of that of the ground
outside which lies among the walls. A building whose door is open may have a closet."""
OPEN = "no walls enclose the start: a robot can leave the map"
"""The note of a world whose start is outside all walls."""


def start_within(
    space: FreeSpace, regions: Sequence[shapely.Polygon], homes: Sequence[Float64[np.ndarray, "2"]]
) -> tuple[Float64[np.ndarray, "2"], tuple[str, ...]] | None:
    """Return the widest place in a region that walls enclose, and notes; None without room.

    The first region with one of the `homes` comes first, then the largest. If walls enclose no
    region, or only closets (see `LEAST_SHARE`), the start lies outside, among the walls.

    Args:
        space: The free space.
        regions: Its regions in which a robot may be.
        homes: Places (m) at which a robot is said to be.
    """
    within = [region for region in regions if space.encloses(region)]
    without = [region for region in regions if not space.encloses(region)]
    largest = max(within, key=lambda region: float(region.area), default=shapely.Polygon())
    for among in (space.hull, space.rectangle):
        parts = [part for region in without for part in _polygons(region.intersection(among))]
        outside = max(parts, key=lambda part: float(part.area), default=shapely.Polygon())
        if within and largest.area >= LEAST_SHARE * outside.area:
            places = [shapely.Point(home) for home in homes]
            at_home = (region for place in places for region in within if region.covers(place))
            if space.is_clear(centre := widest_place(next(at_home, largest))):
                return centre, ()
        if outside.area and space.is_clear(centre := widest_place(outside)):
            return centre, (OPEN,)
    return None


def _polygons(shape: shapely.Geometry) -> list[shapely.Polygon]:
    parts = shapely.get_parts(shape).tolist()
    return [part for part in parts if part.geom_type == "Polygon" and part.area]


def check_coordinates(walls: Segments, source: object) -> None:
    """Check that the walls have the size of a building, before free space is computed.

    Raises:
        InputError: A coordinate is beyond `LARGEST_COORDINATE`.
    """
    if not (np.abs(walls) <= LARGEST_COORDINATE).all():
        raise InputError(source, METRES, f"{np.abs(walls).max():g}", place="walls")


def _start(space: FreeSpace, floor: shapely.Geometry, source: str) -> tuple[Pose, shapely.Polygon]:
    """Return the start, and the region of free space that contains it."""
    region = max(space.regions, key=lambda region: float(region.intersection(floor).area))
    parts = shapely.get_parts(region.intersection(floor))
    part = max(parts, key=lambda part: float(part.area), default=shapely.Polygon())
    centre = widest_place(part) if part.area else None
    if centre is None or not space.is_clear(centre):
        expected = f"a room with space for a robot of radius {space.radius:g} m"
        raise InputError(source, expected, "none")
    return np.array([*centre, 0.0]), region
