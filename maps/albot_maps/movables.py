"""Doors, pushable boxes and walkers of a world, and the checks that they must pass."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Segments
from albot_core.ranges import FINITE, Range, are_numbers, shown
from albot_maps.freespace import FreeSpace, floor_at, wall_lines

Point = tuple[float, float]
"""x, y (m)."""
Span = tuple[float, float]
"""Smallest and largest value of a random draw."""

NARROWEST_LEAF, WIDEST_LEAF = 0.3, 3.0
"""Widths of a door's leaf (m)."""
SMALLEST_SIDE = 0.3
"""Smallest side of a box (m): a much thinner one could pass through a wall in a physics step."""
SHORTEST_LEG = 0.1
"""Shortest leg of a walker's route (m)."""
SMALLEST_OPENING, LARGEST_OPENING = 0.1, math.pi
"""Angles (rad) by which a leaf opens, to either side."""
_OPENING = Range(
    "an angle from 0.1 to pi rad, or from -pi to -0.1 rad", -LARGEST_OPENING, LARGEST_OPENING
)
_ARC = math.radians(5)
"""Largest angle (rad) of a chord with which a leaf's arc is approximated."""


@dataclass(frozen=True, kw_only=True)
class Door:
    """A door leaf that swings about its hinge and is open and shut in turn.

    It opens and shuts by itself, and waits while something is in its way.

    Raises:
        InputError: A number is not finite or out of its range; the place is the field.
    """

    hinge: Point
    """Position of the hinge (m)."""
    heading: float
    """Direction of the shut leaf from the hinge (rad)."""
    width: float
    """Length of the leaf from the hinge to its other end (m)."""
    opening: float = math.pi / 2
    """Opening angle (rad), counter-clockwise positive; at most half a turn."""
    turn_rate: float = 1.0
    """Angular speed of the leaf (rad/s)."""
    open_for: Span = (5.0, 20.0)
    """Range of the time that it stays open (s), drawn each time."""
    shut_for: Span = (5.0, 20.0)
    """Range of the time that it stays shut (s), drawn each time."""

    def __post_init__(self) -> None:
        _check_point("Door", "hinge", self.hinge)
        _check_heading("Door", self.heading)
        _check_range("Door", "width", self.width, NARROWEST_LEAF, WIDEST_LEAF, "m")
        _check_range("Door", "turn_rate", self.turn_rate, 0.1, 3.0, "rad/s")
        if self.opening not in _OPENING or abs(self.opening) < SMALLEST_OPENING:
            raise InputError("Door", _OPENING.expected, shown(self.opening), place="opening")
        for name in ("open_for", "shut_for"):
            _check_span("Door", name, getattr(self, name), 0.0, 3600.0, "s")
        _drop_negative_zeros(self)

    @property
    def sweep(self) -> shapely.Polygon:
        """The area that the leaf sweeps between shut and open."""
        steps = max(2, math.ceil(abs(self.opening) / _ARC) + 1)
        angles = self.heading + np.linspace(0.0, self.opening, steps)
        arc = np.stack((np.cos(angles), np.sin(angles)), axis=1) * self.width + self.hinge
        return shapely.Polygon([self.hinge, *arc.tolist()])


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box that stands on the floor until something pushes it.

    Raises:
        InputError: A number is not finite or out of its range; the place is the field.
    """

    at: Point
    """Position of its centre when an episode begins (m)."""
    heading: float = 0.0
    """Direction of the side `length` (rad)."""
    length: float = 0.5
    """One side (m)."""
    width: float = 0.5
    """The other side (m)."""
    mass: float = 5.0
    """Mass (kg); the robot's tyres push about 20 kg at most."""

    def __post_init__(self) -> None:
        _check_point("Box", "at", self.at)
        _check_heading("Box", self.heading)
        for name in ("length", "width"):
            _check_range("Box", name, getattr(self, name), SMALLEST_SIDE, 3.0, "m")
        _check_range("Box", "mass", self.mass, 0.5, 1000.0, "kg")
        _drop_negative_zeros(self)

    @property
    def corners(self) -> Points:
        """Its four corners when an episode begins (m), counter-clockwise."""
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (self.length / 2, self.width / 2)
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        corners: Points = half @ np.array([[cos, sin], [-sin, cos]]) + self.at
        return corners

    @property
    def outline(self) -> shapely.Polygon:
        """The area that it covers when an episode begins."""
        return shapely.Polygon(self.corners)


@dataclass(frozen=True, kw_only=True)
class Walker:
    """A person who walks along a route, back and forth or round in a loop.

    Raises:
        InputError: A number is not finite or out of its range; the place is the field.
    """

    route: tuple[Point, ...]
    """Waypoints (m) joined by straight legs."""
    closed: bool = False
    """Whether the last waypoint is joined to the first; otherwise the route is walked back and
    forth."""
    speed: Span = (0.8, 1.4)
    """Range of the speed on a free path (m/s), drawn for each episode."""
    radius: float = 0.25
    """Radius of the body (m)."""

    def __post_init__(self) -> None:
        if len(self.route) < (3 if self.closed else 2):
            expected = "3 waypoints or more" if self.closed else "2 waypoints or more"
            raise InputError("Walker", expected, str(len(self.route)), place="route")
        for point in self.route:
            _check_point("Walker", "route", point)
        _check_range("Walker", "radius", self.radius, 0.15, 0.5, "m")
        _check_span("Walker", "speed", self.speed, 0.1, 2.0, "m/s")
        shortest = float(np.hypot(*(self.legs[:, 2:] - self.legs[:, :2]).T).min())
        if shortest < SHORTEST_LEG:
            expected, found = f"legs of {SHORTEST_LEG} m or more", f"one of {shortest:.3g} m"
            raise InputError("Walker", expected, found, place="route")
        _drop_negative_zeros(self)

    @property
    def legs(self) -> Segments:
        """The legs of the route, (n, 4): x1, y1, x2, y2 (m)."""
        points = np.array(self.route)
        ahead = np.roll(points, -1, axis=0) if self.closed else points[1:]
        legs: Segments = np.concatenate((points[: len(ahead)], ahead), axis=1)
        return legs


@dataclass(frozen=True, kw_only=True)
class Movables:
    """Everything that moves in a world."""

    doors: tuple[Door, ...] = ()
    boxes: tuple[Box, ...] = ()
    walkers: tuple[Walker, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.doors or self.boxes or self.walkers)

    def gap(self, x: float, y: float) -> float:
        """Return the distance (m) of a point to the areas in which no robot may start.

        These are the areas that doors sweep and those that boxes cover at first. Without
        any, the distance is infinite.
        """
        here = shapely.Point(x, y)
        return min((here.distance(shape) for shape in self._barred), default=math.inf)

    @cached_property
    def _barred(self) -> tuple[shapely.Polygon, ...]:
        return tuple([door.sweep for door in self.doors] + [box.outline for box in self.boxes])


def _drop_negative_zeros(thing: Door | Box | Walker) -> None:
    """Turn every -0 into 0, which world files do not distinguish."""
    for item in fields(thing):
        object.__setattr__(thing, item.name, _with_plain_zeros(getattr(thing, item.name)))


def _with_plain_zeros(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return type(value)(map(_with_plain_zeros, value))
    return value + 0.0 if isinstance(value, float) else value


def _check_point(kind: str, name: str, point: object) -> None:
    if not are_numbers(point, 2):
        raise InputError(kind, "two finite numbers, x and y (m)", str(point), place=name)


def _check_heading(kind: str, heading: object) -> None:
    if heading not in FINITE:
        raise InputError(kind, FINITE.expected, shown(heading), place="heading")


def _check_range(kind: str, name: str, value: object, least: float, most: float, unit: str) -> None:
    allowed = Range(f"a number from {least:g} to {most:g} ({unit})", least, most)
    if value not in allowed:
        raise InputError(kind, allowed.expected, shown(value), place=name)


def _check_span(kind: str, name: str, span: Any, least: float, most: float, unit: str) -> None:
    if not are_numbers(span, 2) or not least <= span[0] <= span[1] <= most:
        expected = f"two numbers from {least:g} to {most:g} ({unit}), the smaller first"
        raise InputError(kind, expected, str(span), place=name)


TOLERANCE = 0.01
"""Depth (m) to which a door's leaf may reach into a wall or another door's sweep; also the
smallest distance (m) of a box from everything else."""
_WAY_OUT = 1.0
"""Distance (m) that a robot must be able to drive from a start without pushing a box."""


class Violation(NamedTuple):
    """A check that a movable does not pass."""

    place: str
    """Path of the movable or start, such as `movables.doors[0]`."""
    expected: str
    found: str


class Environment(NamedTuple):
    """The walls and starts with which movables must be compatible."""

    walls: Segments
    starts: Points
    """Positions where robots start (m)."""
    radius: float
    """The robots' radius (m)."""

    @property
    def extent(self) -> shapely.Polygon:
        """The rectangle around the walls."""
        return shapely.box(*wall_lines(self.walls).bounds)


def find_violations(movables: Movables, around: Environment) -> Iterator[Violation]:
    """Yield what is wrong with the movables of a world: doors, boxes, walkers, then starts."""
    lines = wall_lines(around.walls)
    shapely.prepare(lines)
    yield from _door_violations(movables, around, lines)
    yield from _box_violations(movables, around, lines)
    for index, walker in enumerate(movables.walkers):
        for expected, found in _walker_violations(walker, movables, around, lines):
            yield Violation(f"movables.walkers[{index}]", expected, found)
    yield from _enclosed_starts(movables, around)


def _door_violations(
    movables: Movables, around: Environment, lines: shapely.Geometry
) -> Iterator[Violation]:
    sweeps: list[shapely.Polygon] = []
    starts = shapely.points(around.starts)
    for index, door in enumerate(movables.doors):
        place, sweep = f"movables.doors[{index}]", door.sweep
        inner = sweep.buffer(-TOLERANCE)
        if not around.extent.buffer(TOLERANCE).contains(sweep):
            yield Violation(place, "a door inside the building", f"a hinge at {door.hinge}")
        if lines.intersects(inner):
            yield Violation(place, "a leaf that swings clear of the walls", "one blocked by a wall")
        for other, sweep_before in enumerate(sweeps):
            if inner.intersects(sweep_before):
                expected = "a leaf that swings clear of the other doors'"
                yield Violation(place, expected, f"one that meets doors[{other}]")
        if shapely.distance(starts, sweep).min() < around.radius:
            expected = f"a leaf that stays {around.radius} m clear of the starts"
            yield Violation(
                place, expected, f"one at {shapely.distance(starts, sweep).min():.3g} m"
            )
        sweeps.append(inner)


def _box_violations(
    movables: Movables, around: Environment, lines: shapely.Geometry
) -> Iterator[Violation]:
    if not movables.boxes:
        return
    starts = shapely.points(around.starts)
    outlines = [box.outline for box in movables.boxes]
    floor = floor_at(around.walls, around.starts[0])
    for index, outline in enumerate(outlines):
        place = f"movables.boxes[{index}]"
        distances = {"a wall": outline.distance(lines)}
        distances |= {f"boxes[{k}]": outline.distance(outlines[k]) for k in range(index)}
        distances |= {
            f"the swept area of doors[{k}]": outline.distance(door.sweep)
            for k, door in enumerate(movables.doors)
        }
        for what, distance in distances.items():
            if distance < TOLERANCE:
                found = f"{what} at {distance:.3g} m"
                yield Violation(place, f"a box at least {TOLERANCE} m from everything else", found)
        # Only now: of a box on a wall, the wall is what has to be told.
        at = movables.boxes[index].at
        if not around.extent.contains(outline):
            yield Violation(place, "a box inside the building", f"one at {at}")
        if not floor.contains(shapely.Point(at)):
            expected = "a box on the floor of the starts"
            found = f"one at {at}, inside furniture or behind walls without an opening"
            yield Violation(place, expected, found)
        nearest = float(shapely.distance(starts, outline).min())
        if nearest < around.radius:
            expected = f"a box {around.radius} m clear of the starts"
            yield Violation(place, expected, f"one at {nearest:.3g} m")


def _walker_violations(
    walker: Walker, movables: Movables, around: Environment, lines: shapely.Geometry
) -> Iterator[tuple[str, str]]:
    legs = shapely.linestrings(walker.legs.reshape(-1, 2, 2))
    if not around.extent.contains(shapely.union_all(legs)):
        yield "a route inside the building", "one that leaves it"
    obstacles = [lines, *(box.outline for box in movables.boxes)]
    clearance = min(float(shapely.distance(legs, obstacle).min()) for obstacle in obstacles)
    if clearance < walker.radius:
        expected = f"a route {walker.radius:g} m clear of walls and boxes"
        yield expected, f"one at {clearance:.3g} m"
    # Then some waypoint is free wherever the robot starts.
    points = np.array(walker.route)
    spread = float(np.hypot(*(points[:, np.newaxis] - points).T).max())
    least = 2 * (around.radius + walker.radius + TOLERANCE)
    if spread < least:
        yield f"waypoints {least:g} m apart", f"at most {spread:.3g} m"


def _enclosed_starts(movables: Movables, around: Environment) -> Iterator[Violation]:
    """Yield the starts from which a robot cannot drive away without pushing a box."""
    outlines = shapely.union_all([box.outline for box in movables.boxes])
    for index, start in enumerate(around.starts):
        # The distance to an empty shape is nan.
        if not shapely.Point(start).distance(outlines) < _WAY_OUT + around.radius:
            continue
        sides = [_sides(box.corners) for box in movables.boxes]
        bare = FreeSpace(around.walls, around.radius)
        full = FreeSpace(np.concatenate((around.walls, *sides)), around.radius)
        if _reach(full, start) < min(_WAY_OUT, _reach(bare, start)):
            expected = "a path out between the boxes"
            yield Violation(f"starts[{index}]", expected, "boxes on all sides")


def _sides(corners: Points) -> Segments:
    return np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)


def _reach(space: FreeSpace, start: np.ndarray) -> float:
    """Return the largest straight-line distance (m) that the disc gets from a start."""
    here = shapely.Point(start)
    return float(shapely.hausdorff_distance(space.region_at(start).exterior, here))
