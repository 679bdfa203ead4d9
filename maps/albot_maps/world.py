"""The world: an immutable, validated floor plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import shapely
from jaxtyping import Bool, Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Poses, Segments
from albot_core.ranges import POSITIVE, check_fields
from albot_core.robot import PIONEER_3DX
from albot_maps.freespace import MARGIN, FreeSpace, wall_lines
from albot_maps.movables import Environment, Movables, find_violations

ROBOT_RADIUS = PIONEER_3DX.radius
"""Radius (m) of the robot for which a world is made and checked by default."""

LARGEST_COORDINATE = 10_000.0
"""Largest absolute coordinate (m); larger ones are probably not in metres."""

SHORTEST_WALL = 1e-6
"""A wall of this length (m) or less counts as a point, and is an error."""

DEEPEST_EXIT = 1.0
"""Largest distance (m) of an exit's line from its two rooms: a wall may be so thick."""

_ROUNDING = 0.002
"""Distance (m) outside the polygonal free space at which a point still counts as free; also how
far from an exit's line its two sides begin."""

METRES = f"finite numbers in metres, within ±{LARGEST_COORDINATE:g}"
"""Text for coordinates in error messages: what is expected."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """A named part of the floor."""

    name: str
    boundary: Float64[np.ndarray, "corners 2"]
    """Corners of the room's outline (m), a simple polygon."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "boundary", _read_only(self.boundary))


@dataclass(frozen=True, kw_only=True, eq=False)
class Exit:
    """An opening between two rooms: a doorway, or the mouth of a corridor."""

    name: str
    segment: Float64[np.ndarray, "4"]
    """The line across the opening: x1, y1, x2, y2 (m)."""
    rooms: tuple[str, str]
    """Names of the rooms on its two sides, within `DEEPEST_EXIT` of the middle of the line."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "segment", _read_only(self.segment))


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """One floor of a building. World frame: x right, y up on the plan, in metres.

    Every instance is valid: all numbers are finite and in metres, no wall is a point, names are
    unique, a robot of radius `robot_radius` fits at every start, which is near the walls, can enter
    every room from the first start (with doors open and boxes pushed away) and follows every tour
    clear of the walls, and movables have room. Arrays are read-only copies of the arguments, with
    0 for -0.

    Raises:
        InputError: One of these does not hold; its place is such as `walls[3]` or `exits[0]`.
    """

    name: str
    walls: Segments
    """All fixed obstacles, walls and furniture, as segments: x1, y1, x2, y2 (m)."""
    starts: Poses
    """Poses (x, y, heading; m and rad) at which an episode may start; the first is the default."""
    glass: Bool[np.ndarray, "panes"] = field(default_factory=lambda: np.zeros(0, np.bool_))
    """Whether each wall is glass: light passes, the robot and sound do not. One value per wall;
    an empty array means no glass."""
    rooms: tuple[Room, ...] = field(default=())
    exits: tuple[Exit, ...] = field(default=())
    tours: Mapping[str, Points] = field(default_factory=dict)
    """Routes by name: waypoints (m) joined by straight legs that a robot can drive."""
    notes: tuple[str, ...] = ()
    """What the reader of another format left out or assumed, one sentence each."""
    movables: Movables = field(default_factory=Movables)
    """Doors that open and close, boxes that can be pushed, and walkers."""
    source: str = ""
    """Origin of the world: a file, a catalogue name or a generator's spec."""
    robot_radius: float = ROBOT_RADIUS
    """Radius (m) of the robot for which the world is valid; no part of a world file."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "robot_radius")
        self._freeze()
        self._check_names()
        self._check_walls()
        self._check_rooms_and_exits()
        self._check_starts()
        self._check_tours()
        self._check_reachability()
        self._check_movables()

    def for_robot(self, radius: float) -> World:
        """Return the same world for a robot of another radius (m); itself for the same radius.

        Raises:
            InputError: It is not valid for that robot: a start is not free, for example, or a
                door too narrow.
        """
        return self if radius == self.robot_radius else replace(self, robot_radius=radius)

    @cached_property
    def opaque(self) -> Segments:
        """The walls that stop light: all except glass."""
        return _read_only(self.walls[~self.glass])

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounding rectangle of the walls: x_min, y_min, x_max, y_max (m)."""
        points = self.walls.reshape(-1, 2)
        (x_min, y_min), (x_max, y_max) = points.min(axis=0), points.max(axis=0)
        return float(x_min), float(y_min), float(x_max), float(y_max)

    @cached_property
    def free_space(self) -> FreeSpace:
        """Where the robot's centre can be."""
        return FreeSpace(self.walls, self.robot_radius)

    @cached_property
    def closed(self) -> bool:
        """Whether walls keep a robot that starts at the first start inside the building."""
        return self.free_space.is_enclosed(self.starts[0, :2])

    @cached_property
    def reachable_area(self) -> float:
        """Area of the floor that the robot's body can cover, coming from the starts (m²)."""
        middle = self.free_space.region_at(self.starts[0, :2])
        return float(shapely.buffer(middle, self.robot_radius).area)

    @cached_property
    def reachable_rooms(self) -> tuple[Room, ...]:
        """The rooms that the robot's centre can reach from the starts."""
        middle = self.free_space.region_at(self.starts[0, :2])
        within = [shapely.area(shapely.intersection(middle, each)) for each in self._outlines]
        return tuple(room for room, area in zip(self.rooms, within, strict=True) if area > 0)

    def reaches(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Return whether the robot's centre can reach a point (m) from the starts."""
        middle = self.free_space.region_at(self.starts[0, :2])
        return bool(middle.distance(shapely.Point(point)) < _ROUNDING)

    def room_at(self, x: float, y: float) -> str | None:
        """Return the name of the room that contains the point (m); None outside all rooms.

        A point on the line between two rooms belongs to the one listed first.
        """
        point = shapely.Point(x, y)
        for room, outline in zip(self.rooms, self._outlines, strict=True):
            if outline.covers(point):
                return room.name
        return None

    @cached_property
    def _outlines(self) -> tuple[shapely.Polygon, ...]:
        if not self.rooms:
            return ()
        owners = np.repeat(np.arange(len(self.rooms)), [len(room.boundary) for room in self.rooms])
        corners = np.concatenate([room.boundary for room in self.rooms])
        outlines = shapely.polygons(shapely.linearrings(corners, indices=owners))
        shapely.prepare(outlines)
        return tuple(outlines)

    def _freeze(self) -> None:
        tours = {name: _read_only(waypoints) for name, waypoints in self.tours.items()}
        object.__setattr__(self, "walls", _read_only(self.walls))
        object.__setattr__(self, "starts", _read_only(self.starts))
        glass = np.array(self.glass if len(self.glass) else np.zeros(len(self.walls)), np.bool_)
        glass.flags.writeable = False
        object.__setattr__(self, "glass", glass)
        object.__setattr__(self, "tours", MappingProxyType(tours))

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields as plain data, so that a world can be sent to another process."""
        state = {item.name: getattr(self, item.name) for item in fields(self)}
        return state | {"tours": dict(self.tours)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)
        self._freeze()

    def _error(self, place: str, expected: str, found: str) -> InputError:
        return InputError(self.source or self.name or "world", expected, found, place=place)

    def _check_names(self) -> None:
        self._check_name("name", self.name)
        for kind, names in (
            ("rooms", [room.name for room in self.rooms]),
            ("exits", [opening.name for opening in self.exits]),
            ("tours", list(self.tours)),
        ):
            for index, name in enumerate(names):
                place = f"tours.{name}" if kind == "tours" else f"{kind}[{index}]"
                self._check_name(place, name)
                if name in names[:index]:
                    raise self._error(place, "a unique name", f"{name!r} again")

    def _check_name(self, place: str, name: str) -> None:
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            raise self._error(place, "a name of one printable line", repr(name))

    def _check_numbers(self, kind: str, rows: Sequence[np.ndarray] | np.ndarray) -> None:
        if not len(rows) or (np.abs(np.concatenate(rows, axis=None)) <= LARGEST_COORDINATE).all():
            return
        for index, row in enumerate(rows):
            bad = ~(np.abs(row) <= LARGEST_COORDINATE)
            if bad.any():
                raise self._error(f"{kind}[{index}]", METRES, f"{row[bad].flat[0]:g}")

    def _check_walls(self) -> None:
        if not len(self.walls):
            raise self._error("walls", "at least one wall", "none")
        self._check_numbers("walls", self.walls)
        if len(self.glass) != len(self.walls):
            expected = f"true or false for each of {len(self.walls)} walls"
            raise self._error("glass", expected, str(len(self.glass)))
        lengths = np.hypot(*(self.walls[:, 2:] - self.walls[:, :2]).T)
        for index in np.flatnonzero(lengths <= SHORTEST_WALL):
            x, y = self.walls[index, :2]
            found = f"the point ({x:g}, {y:g})"
            raise self._error(f"walls[{index}]", "a wall longer than 0", found)

    def _check_rooms_and_exits(self) -> None:
        self._check_numbers("rooms", [room.boundary for room in self.rooms])
        self._check_numbers("exits", [opening.segment for opening in self.exits])
        for index, room in enumerate(self.rooms):
            if len(room.boundary) < 3:
                expected = f"an outline of {room.name!r} of 3 corners or more"
                raise self._error(f"rooms[{index}]", expected, str(len(room.boundary)))
        for index in np.flatnonzero(~shapely.is_valid(self._outlines)).tolist():
            expected = f"an outline of {self.rooms[index].name!r} that does not cross itself"
            reason = shapely.is_valid_reason(self._outlines[index])
            raise self._error(f"rooms[{index}]", expected, reason)
        names = {room.name for room in self.rooms}
        for index, opening in enumerate(self.exits):
            place = f"exits[{index}]"
            if (opening.segment[:2] == opening.segment[2:]).all():
                raise self._error(place, f"{opening.name!r} wider than 0", "a point")
            for name in opening.rooms:
                if name not in names:
                    raise self._error(place, f"two rooms of this world at {opening.name!r}", name)
            if opening.rooms[0] == opening.rooms[1]:
                expected = f"two different rooms at {opening.name!r}"
                raise self._error(place, expected, f"{opening.rooms[0]} twice")
        if self.exits:
            self._check_exits_lie_between_their_rooms()

    def _check_exits_lie_between_their_rooms(self) -> None:
        outlines = dict(zip([room.name for room in self.rooms], self._outlines, strict=True))
        segments = np.array([opening.segment for opening in self.exits])
        pairs = np.array([[outlines[name] for name in opening.rooms] for opening in self.exits])
        for index in np.flatnonzero(~lie_between(segments, pairs)).tolist():
            opening = self.exits[index]
            one, other = (
                ", ".join(name for name in outlines if outlines[name].intersects(side)) or "no room"
                for side in _sides(segments)[index]
            )
            first, second = opening.rooms
            raise self._error(
                f"exits[{index}]",
                f"{first} and {second} within {DEEPEST_EXIT:g} m of the two sides of "
                f"{opening.name!r}",
                f"{one} on one side, {other} on the other",
            )

    def _check_starts(self) -> None:
        if self.starts.ndim != 2 or not len(self.starts):
            raise self._error("starts", "at least one start (n, 3)", str(self.starts.shape))
        self._check_numbers("starts", self.starts)
        x_min, y_min, x_max, y_max = self.bounds
        margin = MARGIN * self.robot_radius
        low, high = np.array([x_min, y_min]) - margin, np.array([x_max, y_max]) + margin
        places = self.starts[:, :2]
        for index in np.flatnonzero(((places < low) | (places > high)).any(axis=1)):
            expected = f"at most {margin:g} m outside the rectangle around the walls"
            x, y = places[index]
            raise self._error(f"starts[{index}]", expected, f"({x:g}, {y:g})")
        clearance = shapely.distance(shapely.points(self.starts[:, :2]), wall_lines(self.walls))
        for index in np.flatnonzero(clearance < self.robot_radius):
            raise self._error(
                f"starts[{index}]",
                f"free space of radius {self.robot_radius:g} m",
                f"a wall at {clearance[index]:.3g} m",
            )

    def _check_tours(self) -> None:
        for name, waypoints in self.tours.items():
            place = f"tours.{name}"
            if waypoints.ndim != 2 or len(waypoints) < 2:
                raise self._error(place, "two waypoints or more", str(waypoints.shape))
            self._check_numbers(place, waypoints)
            legs = shapely.linestrings(np.stack((waypoints[:-1], waypoints[1:]), axis=1))
            clearance = shapely.distance(legs, wall_lines(self.walls))
            for index in np.flatnonzero(clearance < self.robot_radius):
                raise self._error(
                    f"{place}[{index}]",
                    f"a leg {self.robot_radius:g} m clear of the walls",
                    f"one at {clearance[index]:.3g} m",
                )

    def _is_surely_reachable(self) -> bool:
        """Return whether a quick proof makes the exact, slow check unnecessary."""
        if not self.rooms and len(self.starts) == 1:
            return True
        from albot_maps.lattice import FloodFill  # compiled code is slow to load

        fill = FloodFill(self.walls, self.robot_radius, self.starts[0, :2])
        return all(fill.reaches(start[:2]) for start in self.starts) and all(
            fill.disc_fits_inside(room.boundary) for room in self.rooms
        )

    def _check_reachability(self) -> None:
        if self._is_surely_reachable():
            return
        region = self.free_space.region_at(self.starts[0, :2])
        for index, start in enumerate(self.starts[1:], 1):
            if self.free_space.region_at(start[:2]) is not region:
                expected = (
                    f"a start that a robot of radius {self.robot_radius:g} m reaches from starts[0]"
                )
                raise self._error(f"starts[{index}]", expected, "a path blocked by walls")
        unreached = [
            index
            for index, outline in enumerate(self._outlines)
            if not self.free_space.disc_fits_inside(region, outline)
        ]
        if unreached:
            names = ", ".join(self.rooms[index].name for index in unreached)
            raise self._error(
                f"rooms[{unreached[0]}]",
                f"rooms that a robot of radius {self.robot_radius:g} m reaches from starts[0]",
                f"no way into {names}",
            )

    def _check_movables(self) -> None:
        if not self.movables:
            return
        around = Environment(self.walls, self.starts[:, :2], self.robot_radius)
        for place, expected, found in find_violations(self.movables, around):
            raise self._error(place, expected, found)


def lie_between(segments: Segments, rooms: np.ndarray) -> Bool[np.ndarray, "exits"]:
    """Return whether each exit's two rooms lie on the two sides of its line's middle.

    Args:
        segments: The lines across the exits (m).
        rooms: The outlines of the two rooms of each exit, polygons (n, 2).
    """
    # (exits, sides, rooms)
    meets = shapely.intersects(_sides(segments)[:, :, np.newaxis], rooms[:, np.newaxis, :])
    between: Bool[np.ndarray, "exits"]
    between = (meets[:, 0, 0] & meets[:, 1, 1]) | (meets[:, 0, 1] & meets[:, 1, 0])
    return between


def _sides(segments: Segments) -> np.ndarray:
    """Return the lines (n, 2) that lead straight away from the middle of each exit, to its sides.

    They begin a little off: an exit may lie on the line between two rooms that touch.
    """
    first, second = segments[:, :2], segments[:, 2:]
    along = (second - first) / np.hypot(*(second - first).T)[:, np.newaxis]
    across = np.stack((-along[:, 1], along[:, 0]), axis=1)
    reach = np.array([_ROUNDING, DEEPEST_EXIT])[:, np.newaxis]
    middle = ((first + second) / 2)[:, np.newaxis]
    ways = [middle + sign * reach * across[:, np.newaxis] for sign in (1.0, -1.0)]
    return np.stack([shapely.linestrings(way) for way in ways], axis=1)


def _read_only(array: np.ndarray) -> np.ndarray:
    copy = np.array(array, dtype=np.float64)
    copy += 0.0  # It turns -0 into 0, which world files do not distinguish.
    copy.flags.writeable = False
    return copy
