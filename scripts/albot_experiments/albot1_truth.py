"""What a network of places says of its exits and surfaces, held against the true floor.

A place's frame is the pose from which the robot first saw the place, so its true pose is known: it
is the robot's at that view. A place's exits and surfaces, placed on the floor by it, are off by the
drift of the map within the place alone. Nothing is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float64
from scipy.spatial import KDTree

from albot_core.evaluation.map_quality import sample_segments
from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.geometry.types import Points
from albot_core.mappers.albot1.places.network_view import Network, Place
from albot_experiments.albot1_places import PlacedTour, middle
from albot_experiments.mapping import Walls
from albot_maps import World
from albot_maps.world import Exit

NEAR_DOOR = 1.0
"""An exit is at a true door if their middles are at most this far apart (m): a doorway's width."""
LEAST_DESCRIBED, LEAST_ON_WALLS = 0.55, 0.85
"""A network describes its places if `walls_described` and `surfaces_on_walls` are at least this.
Between what `albot1` reaches on seeds below 1000, and what it does without the update that an exit
forces, and where a new description takes the place of the old one."""
NEAR_WALL = 0.3
"""A surface is a wall, and a wall is described, within this distance (m): half as much again as the
walls are thick."""
OWN_WALL = 0.25
"""A wall is a room's own within this distance of the room's outline or inside it (m)."""
_SPACING = 0.1


@dataclass(frozen=True, kw_only=True)
class NetworkTruth:
    """How far the values that a network stores agree with the true floor."""

    exits_right: float
    """Share of the exits, two for each door gone through, of which all three values are right."""
    exits_off: float
    """Median distance of the exits from the doors that they are, in their places' frames (m)."""
    walls_described: float
    """The lowest share, over the places, of the room's walls seen that the surfaces describe."""
    surfaces_on_walls: float
    """Share of the length of all surfaces that lies on walls."""

    @property
    def is_described(self) -> bool:
        """Whether the surfaces describe the rooms' walls, and little else."""
        is_whole = self.walls_described >= LEAST_DESCRIBED
        return is_whole and self.surfaces_on_walls >= LEAST_ON_WALLS


def judge_network(placed: PlacedTour, world: World) -> NetworkTruth:
    """Return how far the network at the end of a journey agrees with the floor."""
    right, off = judge_exits(placed, world)
    described, on_walls = _surfaces(placed, world, _rooms(placed, world))
    return NetworkTruth(
        exits_right=right, exits_off=off, walls_described=described, surfaces_on_walls=on_walls
    )


def judge_exits(
    placed: PlacedTour, world: World, near_door: float = NEAR_DOOR
) -> tuple[float, float]:
    """Return the share of the exits that are right, and how far they are off (`NetworkTruth`).

    The three values of an exit are its whereabouts, the place it leads to, and the exit of that
    place that it is (section 4.1). An exit of a place that is no single room has no right value. A
    missing exit counts as wrong, and so does one too many.

    Args:
        placed: The journey.
        world: The floor.
        near_door: The distance from a true door within which an exit's whereabouts are right (m).
    """
    network, rooms = placed.mapper.network, _rooms(placed, world)
    doors = [
        [_door_of(placed, place, door.middle, world, near_door) for door in place.exits]
        for place in network.places
    ]
    right: set[tuple[int, str]] = set()
    off = []
    for place, mine in zip(network.places, doors, strict=True):
        for door, true in zip(place.exits, mine, strict=True):
            if true is None:
                continue
            off.append(_off(placed, place, door.middle, true))
            there = _partner(network, doors, door.leads_to, door.exit_there)
            leads_right = {rooms.get(place.id), rooms.get(door.leads_to)} == {*true.rooms}
            if leads_right and there is true:
                right.add((place.id, true.name))
    due = max(2 * len({crossing.exit for crossing in placed.crossings}), sum(map(len, doors)))
    return len(right) / due if due else 0.0, float(np.median(off)) if off else np.inf


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A journey's network, held against the true floor."""

    placed: PlacedTour
    is_right: bool
    """Whether its places are the rooms, and its links the doors."""
    truth: NetworkTruth
    """Its exits and surfaces."""

    @classmethod
    def of(cls, placed: PlacedTour, world: World) -> Judged:
        """Return the network of a journey, judged."""
        truth = judge_network(placed, world)
        return cls(placed=placed, is_right=placed.is_right(world), truth=truth)

    @property
    def has_exits_right(self) -> bool:
        """Whether all three values of every exit are right."""
        return self.truth.exits_right == 1.0

    @property
    def is_described(self) -> bool:
        """Whether the surfaces of its places are the walls of the rooms."""
        return self.truth.is_described

    @property
    def is_reached(self) -> bool:
        """Whether all is right."""
        return self.is_right and self.has_exits_right and self.is_described


def _rooms(placed: PlacedTour, world: World) -> Mapping[int, str]:
    """Return the room that each place is; none for a place that is several."""
    found = placed.rooms(world)
    return {place: next(iter(names)) for place, names in found.items() if len(names) == 1}


def _placed(placed: PlacedTour, place: Place, point: Points) -> Points:
    """Return a point of a place's frame on the true floor (m)."""
    return transform_points(placed.frames[place.id], point)


def _door_of(
    placed: PlacedTour, place: Place, point: Points, world: World, near_door: float
) -> Exit | None:
    """Return the true door nearest to a point of a place's frame; None if none is near."""
    nearest = min(world.exits, key=lambda door: _off(placed, place, point, door))
    return nearest if _off(placed, place, point, nearest) <= near_door else None


def _off(placed: PlacedTour, place: Place, point: Points, door: Exit) -> float:
    return float(np.hypot(*(_placed(placed, place, point) - middle(door.segment))))


def _partner(
    network: Network, doors: list[list[Exit | None]], leads_to: int, exit_there: int
) -> Exit | None:
    """Return the true door of an exit, given by its place's id and its index there."""
    for place, mine in zip(network.places, doors, strict=True):
        if place.id == leads_to and exit_there < len(mine):
            return mine[exit_there]
    return None


def _surfaces(placed: PlacedTour, world: World, rooms: Mapping[int, str]) -> tuple[float, float]:
    """Return `walls_described` and `surfaces_on_walls` of the places that are one room."""
    described, near, total = [], 0, 0
    walls = KDTree(sample_segments(world.walls, _SPACING))
    for place in placed.mapper.network.places:
        seen = _walls_seen(placed, world, rooms.get(place.id))
        surfaces = transform_segments(placed.frames[place.id], place.surfaces)
        points = sample_segments(surfaces, _SPACING) if len(surfaces) else np.empty((0, 2))
        if len(points):
            away, _ = walls.query(points)
            near, total = near + int((away <= NEAR_WALL).sum()), total + len(points)
        if len(seen):
            away, _ = KDTree(points).query(seen) if len(points) else (np.full(len(seen), np.inf), 0)
            described.append(float((away <= NEAR_WALL).mean()))
    return min(described, default=0.0), near / total if total else 0.0


def _walls_seen(
    placed: PlacedTour, world: World, room: str | None
) -> Float64[np.ndarray, "points 2"]:
    """Return points of a room's own walls seen from inside it, before the last exit crossed (m).

    What is seen after that is part of no description yet: a place is described when it is left.
    """
    last = placed.crossings[-1].view if placed.crossings else 0
    truth = placed.journey.truth[:last]
    inside = [k for k, (x, y) in enumerate(truth[:, :2]) if room and world.room_at(x, y) == room]
    if not inside:
        return np.empty((0, 2))
    readings = [placed.journey.readings[k] for k in inside]
    seen = Walls.of_journey(world.walls, readings, truth[inside]).seen
    outline = next(each.boundary for each in world.rooms if each.name == room)
    own = shapely.distance(shapely.Polygon(outline), shapely.points(seen)) <= OWN_WALL
    return np.asarray(seen[own])
