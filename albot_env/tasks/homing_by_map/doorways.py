"""Doorways that could be cut into the walls between two rooms of a world."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Bool

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Segments
from albot_maps import World
from albot_maps.geodesic import DistanceField
from albot_maps.world import Exit

WIDTH = 1.0
"""Width of a doorway (m)."""
THICKEST = 0.5
"""Two rooms with no more than this between them share a wall (m)."""
DEPTH = 1.0
"""The floor is free so far before and behind a doorway (m)."""
MORE = 10
"""Number of doorways that are cut into a world (see `with_more_doors`)."""
_BESIDE = 0.1
"""Wall that is left on each side of a doorway, at least (m)."""
_SLACK = 0.02
"""Walls are found so far beside the two rooms' outlines (m)."""


class Doorway(NamedTuple):
    """A doorway that could be cut."""

    line: Segments
    """(1, 4): the line across its middle (m)."""
    before: Points
    """A point before it, in the first room (m)."""
    behind: Points
    """A point behind it, in the second room (m)."""
    rooms: tuple[str, str]
    """Names of the two rooms."""
    hole: shapely.Polygon
    """What is cut out of the walls."""


def possible_doorways(world: World) -> tuple[Doorway, ...]:
    """Return a doorway for each pair of rooms that share a wall, where the floor is free there."""
    walls = shapely.linestrings(world.walls.reshape(-1, 2, 2))
    tree = shapely.STRtree(walls)
    outlines = [shapely.Polygon(room.boundary) for room in world.rooms]
    found = []
    for one in range(len(outlines)):
        near = [k for k in range(one) if outlines[k].distance(outlines[one]) < THICKEST]
        for other in near:
            doorway = _between(world, one, other, outlines, tree)
            if doorway is not None:
                found.append(doorway)
    return tuple(found)


def _between(
    world: World, one: int, other: int, outlines: list[shapely.Polygon], tree: shapely.STRtree
) -> Doorway | None:
    """Return the doorway nearest to the middle of a wall of two rooms; None if none fits."""
    corners = world.rooms[one].boundary
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = math.dist(start, end)
        if length < WIDTH + 2 * _BESIDE:
            continue
        along = (end - start) / length
        across = np.array((along[1], -along[0]))
        if outlines[one].contains(shapely.Point(0.5 * (start + end) + 0.05 * across)):
            across = -across
        steps = np.arange(0.5 * WIDTH + _BESIDE, length - 0.5 * WIDTH - _BESIDE + 1e-9, 0.25)
        for at in steps[np.argsort(np.abs(steps - 0.5 * length), kind="stable")]:
            middle = start + at * along
            doorway = _at(world, middle, along, across, (one, other), outlines, tree)
            if doorway is not None:
                return doorway
    return None


def _at(
    world: World,
    middle: Points,
    along: Points,
    across: Points,
    rooms: tuple[int, int],
    outlines: list[shapely.Polygon],
    tree: shapely.STRtree,
) -> Doorway | None:
    """Return the doorway at a point of the first room's outline; None if none fits there."""
    one, other = rooms
    probe = shapely.LineString((middle, middle + (THICKEST + DEPTH) * across))
    inside = probe.intersection(outlines[other])
    if inside.is_empty or inside.length < DEPTH:
        return None
    gap = shapely.Point(middle).distance(inside)
    if gap > THICKEST:
        return None

    def strip(half: float, first: float, last: float) -> shapely.Polygon:
        ends = ((-half, first), (half, first), (half, last), (-half, last))
        return shapely.Polygon([middle + a * along + b * across for a, b in ends])

    half = 0.5 * WIDTH
    free = strip(half, -DEPTH, -_SLACK), strip(half, gap + _SLACK, gap + DEPTH)
    if any(len(tree.query(each, predicate="intersects")) for each in free):
        return None
    if not (outlines[one].contains(free[0]) and outlines[other].contains(free[1])):
        return None
    wide = strip(half + _BESIDE, -_SLACK, gap + _SLACK)
    cut = world.walls[tree.query(wide, predicate="intersects")]
    directions = cut[:, 2:] - cut[:, :2]
    lengths = np.hypot(*directions.T)
    if not len(cut) or (np.abs(directions @ across) > 0.05 * lengths).any():
        return None
    centre = middle + 0.5 * gap * across
    return Doorway(
        line=np.concatenate((centre - half * along, centre + half * along))[np.newaxis],
        before=middle - 0.5 * DEPTH * across,
        behind=middle + (gap + 0.5 * DEPTH) * across,
        rooms=(world.rooms[one].name, world.rooms[other].name),
        hole=strip(half, -_SLACK, gap + _SLACK),
    )


def with_doorway(world: World, doorway: Doorway) -> World | None:
    """Return a world with a doorway cut into a wall; None if it were not valid."""
    walls, glass = _cut(world.walls, world.glass, doorway)
    line = doorway.line[0]
    name = f"cut {doorway.rooms[0]}-{doorway.rooms[1]}"
    cut = Exit(name=name, segment=line, rooms=doorway.rooms)
    try:
        return replace(world, walls=walls, glass=glass, exits=(*world.exits, cut))
    except InputError:
        return None


def _cut(
    walls: Segments, glass: Bool[np.ndarray, "walls"], doorway: Doorway
) -> tuple[np.ndarray, np.ndarray]:
    """Return walls (n, 4) and which are glass (n,) after a doorway is cut, with its jambs."""
    kept, is_glass, faces = [], [], []
    for wall, pane in zip(walls, glass, strict=True):
        line = shapely.LineString(wall.reshape(2, 2))
        if not line.intersects(doorway.hole):
            kept.append(wall)
            is_glass.append(pane)
            continue
        rest = line.difference(doorway.hole)
        faces.append(line.intersection(doorway.hole))
        for part in getattr(rest, "geoms", [rest]):
            if part.length > 1e-3:
                kept.append(np.array(part.coords).reshape(-1)[:4])
                is_glass.append(pane)
    line = doorway.line[0]
    across = np.array((line[3] - line[1], line[0] - line[2])) / WIDTH
    offsets = [(np.array(face.coords) - line[:2]) @ across for face in faces if face.length > 0]
    if offsets:
        low, high = min(map(np.min, offsets)), max(map(np.max, offsets))
        for end in (line[:2], line[2:]) if high - low > 1e-3 else ():
            kept.append(np.concatenate((end + low * across, end + high * across)))
            is_glass.append(False)
    return np.array(kept), np.array(is_glass, np.bool_)


def length_through(doorway: Doorway, home: DistanceField, robot: DistanceField) -> float:
    """Return the length of the way home through a doorway that is not there yet (m).

    Args:
        doorway: The doorway.
        home: Geodesic distances home.
        robot: Geodesic distances from the robot.
    """
    between = math.dist(doorway.before, doorway.behind)
    forth = robot.distance(doorway.before) + between + home.distance(doorway.behind)
    back = robot.distance(doorway.behind) + between + home.distance(doorway.before)
    return min(forth, back)


def with_more_doors(world: World) -> World:
    """Return a world with up to `MORE` further doorways, spread evenly over the possible ones.

    Most buildings are trees of rooms: without further doors, no door can be shut so that there is
    another way, nor is any the only short one.
    """
    possible = possible_doorways(world)
    for number in np.unique(
        np.linspace(0, len(possible) - 1, MORE).astype(int) if possible else []
    ):
        world = with_doorway(world, possible[int(number)]) or world
    return world
