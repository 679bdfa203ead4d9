"""Complete a plan that states no start: choose one, and find the rooms that a robot can reach."""

from __future__ import annotations

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_maps.freespace import FreeSpace
from albot_maps.world import LARGEST_COORDINATE, METRES, ROBOT_RADIUS, Exit, Room, World


def reachable_world(
    *,
    name: str,
    walls: Segments,
    rooms: tuple[Room, ...],
    exits: tuple[Exit, ...],
    notes: tuple[str, ...],
    source: str,
) -> World:
    """Return the world of a plan that states no start.

    The start is the centre of the widest place in the largest connected part of the rooms. Rooms
    that the robot cannot reach from there keep their walls, but they and their exits are left
    out, and a note names them.

    Raises:
        InputError: A wall is beyond `LARGEST_COORDINATE`, or the robot fits in no room.
    """
    check_coordinates(walls, source)
    space = FreeSpace(walls, ROBOT_RADIUS)
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
    )


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
    part = max(parts, key=lambda part: float(part.area), default=None)
    if part is None or not part.area:
        raise InputError(
            source, f"a room with space for a robot of radius {ROBOT_RADIUS} m", "none"
        )
    centre = shapely.maximum_inscribed_circle(part, tolerance=0.05).coords[0]
    return np.array([*np.round(centre, 2), 0.0]), region
