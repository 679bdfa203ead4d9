"""Changes between the way out and the way home, of which the robot is told nothing.

A door may have been shut, so that the way home is a detour; or opened, so that there is a shorter
one (Tolman, Cognitive maps in rats and men, Psychological Review 1948). The robot may have been
carried to another room, or furniture may have been moved. Doors are the exits that a world lists,
and doorways that are cut into its walls (`doorways`). A changed world is valid like any other: each
room can be reached.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from jaxtyping import Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.ranges import SHARE, check_fields
from albot_maps import World
from albot_maps.geodesic import DistanceField
from albot_maps.same_place import DOORWAY
from albot_maps.world import Exit

CHANGES = ("none", "door_shut", "door_opened", "carried", "furniture_moved")
"""The kinds of changes."""
LONGER = 1.2
"""A door changes the way home if it makes the way so many times as long, or the other way round."""
SPARE = 0.2
"""A door that is shut leaves so much room beside the robot (m)."""
FAR = 5.0
"""A robot is carried at least so far, on the shortest way (m)."""
LARGEST_PIECE = 3.0
"""What stands free of all other walls, and is no longer than this (m), is furniture."""
APART = 0.75
"""Furniture that has been moved leaves this much room to everything else (m)."""
_TRIES = 40
"""Number of random poses that are tried."""


@dataclass(frozen=True, kw_only=True)
class ChangesConfig:
    """Shares of episodes before which something was changed; nothing was before the others.

    Where a change is impossible, because the world has no such door, for example, nothing is.
    """

    door_shut: float = 0.2
    """A door on the shortest way home was shut; there is another way."""
    door_opened: float = 0.2
    """A door was opened that was shut on the way out; through it the way home is shorter."""
    carried: float = 0.1
    """The robot was carried to another room and turned."""
    furniture_moved: float = 0.1
    """Furniture was moved within its rooms."""

    def __post_init__(self) -> None:
        check_fields(self, SHARE, *vars(self))
        total = math.fsum(vars(self).values())
        if total > 1.0 + 1e-9:
            raise InputError("ChangesConfig", "shares that sum to at most 1", f"{total:g}")

    def draw(self, rng: np.random.Generator) -> str:
        """Draw a kind of change, by one random number."""
        number = rng.random()
        for kind in CHANGES[1:]:
            number -= getattr(self, kind)
            if number < 0.0:
                return kind
        return "none"


class ChangedWorld(NamedTuple):
    """A world after a change, and the way home in it."""

    world: World
    field: DistanceField
    """Geodesic distances home from everywhere."""


def doors_of(world: World) -> tuple[Exit, ...]:
    """Return the exits of a world that are as narrow as doorways."""
    return tuple(
        each for each in world.exits if math.dist(each.segment[:2], each.segment[2:]) <= DOORWAY
    )


def with_walls(world: World, walls: Segments, glass: np.ndarray) -> World | None:
    """Return a world with other walls; None if it were not valid."""
    try:
        return replace(world, walls=walls, glass=glass)
    except InputError:
        return None


def with_door_shut(world: World, door: Exit) -> World | None:
    """Return a world with a wall across a door; None if a room could not be reached then."""
    walls = np.concatenate((world.walls, door.segment[np.newaxis]))
    return with_walls(world, walls, np.append(world.glass, False))


def shut_on_way_home(
    world: World, field: DistanceField, position: Points, home: Points
) -> ChangedWorld | None:
    """Shut the first door on the shortest way home that can be shut, and makes the way longer.

    Args:
        world: The world.
        field: Geodesic distances home.
        position: Where the robot is (m).
        home: Where home is (m).

    Returns:
        The world, with another way home that is at least `LONGER` times as long; None if there is
        no such door.
    """
    way = np.concatenate((position[np.newaxis], field.path(position)))
    for door in _crossed(world, way):
        leaf = shapely.LineString(np.reshape(door.segment, (2, 2)))
        if leaf.distance(shapely.Point(position)) < world.robot_radius + SPARE:
            continue  # The robot stands in it.
        changed = with_door_shut(world, door)
        if changed is None:
            continue
        around = DistanceField(changed.walls, changed.robot_radius, home)
        length = around.distance(position)
        if LONGER * field.distance(position) <= length < math.inf:
            return ChangedWorld(changed, around)
    return None


def _crossed(world: World, way: Points) -> Iterator[Exit]:
    """Yield the doors that a way crosses, in its order."""
    doors = doors_of(world)
    lines = [shapely.LineString(np.reshape(door.segment, (2, 2))) for door in doors]
    for leg in pairwise(way):
        path = shapely.LineString(leg)
        met = [
            (path.project(shapely.Point(path.intersection(line).coords[0])), k)
            for k, line in enumerate(lines)
            if path.length > 0 and path.intersects(line)
        ]
        yield from (doors[k] for _, k in sorted(met))


def openable_doors(world: World, field: DistanceField) -> Iterator[World]:
    """Yield the world with one door shut, for each door that makes some ways home longer.

    Only doors are shut without which a room is at least `LONGER` times as far from home.

    Args:
        world: The world.
        field: Geodesic distances home.
    """
    home = field.anchors[0, :2] * field.cell + field.corner
    middles = np.array([room.boundary.mean(axis=0) for room in world.rooms])
    before = np.array([field.distance(middle) for middle in middles])
    for door in doors_of(world):
        shut = with_door_shut(world, door)
        if shut is None:
            continue
        around = DistanceField(shut.walls, shut.robot_radius, home)
        after = np.array([around.distance(middle) for middle in middles])
        known = np.isfinite(before) & np.isfinite(after) & (before > 0)
        if (after[known] >= LONGER * before[known]).any():
            yield shut


def carried_pose(
    world: World, field: DistanceField, position: Points, rng: np.random.Generator
) -> Pose | None:
    """Draw a pose in another room, `FAR` from the robot and from home; None if none is found."""
    here = world.room_at(*position.tolist())
    away = DistanceField(world.walls, world.robot_radius, position)
    rooms = [room for room in world.reachable_rooms if room.name != here]
    outlines = [shapely.Polygon(room.boundary) for room in rooms]
    for _ in range(_TRIES if rooms else 0):
        k = int(rng.integers(len(rooms)))
        low, high = np.array(outlines[k].bounds).reshape(2, 2)
        point, heading = rng.uniform(low, high), rng.uniform(-math.pi, math.pi)
        is_inside = outlines[k].contains(shapely.Point(point)) and world.reaches(point)
        is_free = world.movables.gap(*point.tolist()) > 2 * world.robot_radius
        if is_inside and is_free and min(away.distance(point), field.distance(point)) >= FAR:
            return np.array((*point, heading))
    return None


def furniture_of(world: World) -> list[Int64[np.ndarray, "walls"]]:
    """Return the walls of each piece of furniture, by index.

    Walls that share an end belong together. A piece is a group that closes around itself and is no
    longer than `LARGEST_PIECE`.
    """
    ends = np.round(world.walls.reshape(-1, 2), 6)
    _, corner = np.unique(ends, axis=0, return_inverse=True)
    corners = corner.reshape(-1, 2)
    size = int(corners.max()) + 1
    joined = csr_array((np.ones(len(corners)), corners.T), shape=(size, size))
    _, group = connected_components(joined, directed=False)
    pieces = []
    degree = np.bincount(corners.ravel())
    for number in np.unique(group):
        walls = np.flatnonzero(group[corners[:, 0]] == number)
        points = world.walls[walls].reshape(-1, 2)
        is_closed = (degree[corners[walls]] >= 2).all()
        if is_closed and len(walls) >= 3 and np.ptp(points, axis=0).max() <= LARGEST_PIECE:
            pieces.append(walls)
    return pieces


def with_furniture_moved(world: World, position: Points, rng: np.random.Generator) -> World | None:
    """Move half of the furniture, each piece within its room; None if no piece can be moved.

    A piece that touches a wall with nothing but its side stays where it is, as do pieces for which
    no free spot is found. None is put where the robot is, nor at a start.
    """
    walls, moved = world.walls.copy(), False
    outlines = [shapely.Polygon(room.boundary) for room in world.rooms]
    taken = shapely.multipoints(np.concatenate((world.starts[:, :2], position[np.newaxis])))
    for piece in furniture_of(world):
        if rng.random() < 0.5:
            continue
        others = np.delete(walls, piece, axis=0)
        if not len(others):  # All that there is: a building of one cell, or a post.
            continue
        obstacles = shapely.multilinestrings(list(others.reshape(-1, 2, 2)))
        shape = shapely.MultiPoint(walls[piece].reshape(-1, 2)).convex_hull
        if obstacles.distance(shape) < 1e-3:
            continue
        room = next((each for each in outlines if each.covers(shape.centroid)), None)
        spot = None if room is None else _free_spot(shape, room, (obstacles, taken), rng)
        if spot is not None:
            walls[piece] += np.tile(spot, 2)
            moved = True
    return with_walls(world, walls, world.glass) if moved else None


def _free_spot(
    shape: shapely.Geometry,
    room: shapely.Polygon,
    obstacles: tuple[shapely.Geometry, shapely.Geometry],
    rng: np.random.Generator,
) -> Points | None:
    """Draw a shift (m) that puts a piece elsewhere in its room; None if none is found."""
    low, high = np.array(room.bounds).reshape(2, 2)
    middle = np.array(shape.centroid.coords[0])
    for _ in range(_TRIES):
        shift = rng.uniform(low, high) - middle
        there = shapely.affinity.translate(shape, *shift.tolist())
        is_apart = all(each.distance(there) >= APART for each in obstacles)
        if math.hypot(*shift) >= APART and room.covers(there) and is_apart:
            return np.asarray(shift)
    return None
