"""Add further starts, doors, people and boxes to a random building."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice, pairwise
from typing import TypeVar

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_maps.freespace import FreeSpace, floor_at, wall_lines
from albot_maps.generators.parameters import Parameters
from albot_maps.generators.plan import WALL, Sampler
from albot_maps.movables import TOLERANCE, Box, Door, Movables, Point, Walker
from albot_maps.world import Exit, World

_START_SPARE = 0.05
"""Extra distance of a start from walls beyond the robot's radius (m)."""
_START_TRIES = 1000
"""Number of attempts per start."""
_HEADINGS = 24
"""Number of headings, evenly spaced over the circle."""


def scatter_starts(world: World, parameters: Parameters, sampler: Sampler) -> World:
    """Return the world with `parameters.starts` starts, the generator's own one first.

    The others are drawn uniformly from the rooms' floor that a robot reaches from the first, with
    uniformly drawn headings.

    Raises:
        InputError: There is not enough free floor for this number.
    """
    wanted = parameters.starts
    if wanted == 1:
        return world
    free = FreeSpace(world.walls, world.robot_radius + _START_SPARE).region_at(world.starts[0, :2])
    shapely.prepare(free)
    x1, y1, x2, y2 = (round(100 * bound) for bound in free.bounds)
    starts = [world.starts[0]]
    for _ in range(_START_TRIES * (wanted - 1)):
        x, y = sampler.length(x1, x2) / 100, sampler.length(y1, y2) / 100
        heading = float(np.deg2rad(360 / _HEADINGS * sampler.integer(0, _HEADINGS - 1)))
        if world.room_at(x, y) is not None and free.contains(shapely.Point(x, y)):
            starts.append(np.array([x, y, heading]))
            if len(starts) == wanted:
                return replace(world, starts=np.array(starts))
    found = str(wanted)
    raise InputError(world.source, f"at most {len(starts)} (all that fit)", found, place="starts")


Thing = TypeVar("Thing", Box, Door, Walker)

_TRIES = 80
"""Number of attempts per door, person or box."""
_BEFORE_EXIT = 0.5
"""Distance before and behind an exit at which a route has a waypoint (m)."""
_SPARE = 0.05
"""Extra distance of routes and boxes from walls beyond what is required (m)."""
_AWAY = {"start": 1.3, "doorways": 0.3, "routes": 0.35, "boxes": 0.1}
"""Distance of boxes from other things (m); from starts, large enough never to enclose one."""
_LEAST_ROUTE = 2.0
"""Least distance from a route's first waypoint to its furthest (m)."""


def populate(world: World, parameters: Parameters, sampler: Sampler) -> World:
    """Return the world with the numbers of doors, people and boxes that the parameters request.

    Raises:
        InputError: There is not enough space for them.
    """
    asked = {name: getattr(parameters, name, 0) for name in ("doors", "people", "boxes")}
    if not any(asked.values()):
        return world
    placer = _Placer(world, sampler)
    doors = _take(placer.doors(), asked["doors"], world, "doors")
    people = _take(placer.walkers(), asked["people"], world, "people")
    boxes = _take(placer.boxes(doors, people), asked["boxes"], world, "boxes")
    return replace(world, movables=Movables(doors=doors, boxes=boxes, walkers=people))


def _take(things: Iterator[Thing], number: int, world: World, name: str) -> tuple[Thing, ...]:
    found = tuple(islice(things, number))
    if len(found) < number:
        expected = f"at most {len(found)} (all that fit)"
        raise InputError(world.source, expected, str(number), place=name)
    return found


class _Placer:
    """Places doors, people and boxes in one building."""

    def __init__(self, world: World, sampler: Sampler) -> None:
        self._world = world
        self._sampler = sampler
        self._walls = wall_lines(world.walls)
        shapely.prepare(self._walls)
        self._starts = shapely.multipoints(world.starts[:, :2])
        self._boxes_of = {room.name: _bounds(room.boundary) for room in world.rooms}
        self._exits_of: dict[str, list[Exit]] = {room.name: [] for room in world.rooms}
        for opening in world.exits:
            for room in opening.rooms:
                self._exits_of[room].append(opening)

    def doors(self) -> Iterator[Door]:
        """Yield a door for each doorway in which one can swing, in random order."""
        sweeps: list[shapely.Polygon] = []
        openings = [opening for opening in self._world.exits if _is_doorway(opening)]
        for opening in self._sampler.shuffled(openings):
            for door in self._sampler.shuffled(_leaves(opening)):
                sweep = door.sweep
                inner = sweep.buffer(-TOLERANCE)
                if (
                    sweep.distance(self._starts) > self._world.robot_radius + _SPARE
                    and not self._walls.intersects(inner)
                    and not any(sweep.intersects(other) for other in sweeps)
                ):
                    sweeps.append(sweep)
                    yield door
                    break

    def walkers(self) -> Iterator[Walker]:
        """Yield people who walk through rooms; stop after `_TRIES` failed attempts in a row."""
        tries = 0
        while tries < _TRIES:
            walker = self._draw_walker()
            tries += 1
            if walker is not None:
                tries = 0
                yield walker

    def _draw_walker(self) -> Walker | None:
        room = self._sampler.pick(self._world.rooms).name
        route = [self._draw_point(room)]
        for _ in range(self._sampler.integer(2, 12)):
            beyond, points = self._draw_step(room)
            if self._is_clear([route[-1], *points]):
                room = beyond
                route += points
        if max(math.dist(route[0], point) for point in route) < _LEAST_ROUTE:
            return None
        closed = len(route) > 2 and self._sampler.bernoulli(0.5)
        closed = closed and self._is_clear([route[-1], route[0]])
        return Walker(route=tuple(route), closed=closed)

    def _draw_step(self, room: str) -> tuple[str, list[Point]]:
        """Draw a step of a route: through an exit, or to a point in the same room."""
        exits = self._exits_of[room]
        if not exits or self._sampler.bernoulli(0.4):
            return room, [self._draw_point(room)]
        opening = self._sampler.pick(exits)
        (beyond,) = set(opening.rooms) - {room}
        sides = _sides(opening)
        sides.sort(key=lambda point: self._world.room_at(*point) != room)
        return beyond, sides

    def _draw_point(self, room: str) -> Point:
        x1, y1, x2, y2 = self._boxes_of[room]
        return self._sampler.length(x1, x2) / 100, self._sampler.length(y1, y2) / 100

    def _is_clear(self, points: Sequence[Point]) -> bool:
        """Return whether legs exceed 10 cm and are clear of walls for a walker of default size."""
        steps = [math.dist(first, second) for first, second in pairwise(points)]
        room = Walker.radius + _SPARE
        return min(steps) > 0.1 and shapely.LineString(points).distance(self._walls) >= room

    def boxes(self, doors: Sequence[Door], people: Sequence[Walker]) -> Iterator[Box]:
        """Yield boxes on free floor; stop after `_TRIES` failed attempts in a row."""
        sweeps = shapely.union_all([door.sweep for door in doors])
        legs = [shapely.linestrings(walker.legs.reshape(-1, 2, 2)) for walker in people]
        routes = shapely.union_all(np.concatenate(legs) if legs else [])
        doorways = [opening.segment for opening in self._world.exits if _is_doorway(opening)]
        kept = [
            (self._walls, _SPARE),
            (self._starts, _AWAY["start"]),
            (wall_lines(np.reshape(doorways, (-1, 4))), _AWAY["doorways"]),
            (routes, _AWAY["routes"]),
            (sweeps, _SPARE),
        ]
        floor = floor_at(self._world.walls, self._world.starts[0, :2])
        shapely.prepare(floor)
        tries = 0
        while tries < _TRIES:
            box = self._draw_box()
            tries += 1
            outline = box.outline
            if not floor.contains(shapely.Point(box.at)):
                continue
            # The distance to an empty shape is nan.
            if any(outline.distance(other) < gap for other, gap in kept):
                continue
            kept.append((outline, _AWAY["boxes"]))
            tries = 0
            yield box

    def _draw_box(self) -> Box:
        at = self._draw_point(self._sampler.pick(self._world.rooms).name)
        return Box(
            at=at,
            heading=float(np.deg2rad(15.0 * self._sampler.integer(0, 11))),
            length=self._sampler.length(40, 70) / 100,
            width=self._sampler.length(30, 50) / 100,
            mass=float(self._sampler.integer(2, 10)),
        )


def _is_doorway(opening: Exit) -> bool:
    return opening.name.startswith("D")


def _leaves(opening: Exit) -> list[Door]:
    """Return the four doors whose shut leaf is flush with a face of the wall."""
    ends = opening.segment.reshape(2, 2)
    doors = []
    for hinge, tip in ((ends[0], ends[1]), (ends[1], ends[0])):
        along = (tip - hinge) / np.abs(tip - hinge).sum()
        quarter = round(2 * math.atan2(along[1], along[0]) / math.pi)
        for side in (1, -1):
            face = side * WALL / 200 * np.array([-along[1], along[0]])
            x, y = (hinge + face).tolist()
            doors.append(
                Door(
                    hinge=(x, y),
                    heading=float(np.deg2rad(90.0 * quarter)),
                    width=float(np.abs(tip - hinge).sum()),
                    opening=side * math.pi / 2,
                )
            )
    return doors


def _sides(opening: Exit) -> list[Point]:
    """Return the points before and behind the centre of an exit."""
    first, second = opening.segment.reshape(2, 2)
    along = (second - first) / np.abs(second - first).sum()
    middle, across = (first + second) / 2, np.array([-along[1], along[0]])
    sides = (middle - _BEFORE_EXIT * across, middle + _BEFORE_EXIT * across)
    return [(float(x), float(y)) for x, y in sides]


def _bounds(boundary: np.ndarray) -> tuple[int, int, int, int]:
    """Return the bounding rectangle of a room (cm)."""
    (x1, y1), (x2, y2) = boundary.min(axis=0), boundary.max(axis=0)
    x1, y1, x2, y2 = (round(100 * float(value)) for value in (x1, y1, x2, y2))
    return x1, y1, x2, y2
