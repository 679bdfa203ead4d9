"""Read the XML floor plans of schools and offices by Luperto and others.

Such a file (github.com/goldleaf3i/generativeCMLgraphs) draws each space of one floor as a
polygon in pixels, y downward, and lists the portals that join two spaces. A portal is a point
on a wall, without a width; a door is cut there. The walls are the sides of the polygons. The
file's own wall segments are not used: neighbouring spaces do not fit together in them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers.expat import ErrorString

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.files import read_bytes
from albot_core.geometry.types import Points, Segments
from albot_core.plain_data import LARGEST
from albot_maps.formats.reachable import reachable_world
from albot_maps.world import SHORTEST_WALL, Exit, Room, World, lie_between


@dataclass(frozen=True, kw_only=True, eq=False)
class _Space:
    """A space of the plan (m, y upward)."""

    name: str
    outline: shapely.Polygon


@dataclass(frozen=True, kw_only=True)
class _Portal:
    """Two spaces joined at a point (m) of their walls; the point is None if the plan omits it."""

    spaces: tuple[str, str]
    point: shapely.Point | None


def read_plan_xml(path: Path, robot_radius: float) -> World:
    """Return the world in an XML floor plan, for a robot of this radius (m).

    Doors are 0.9 m wide. The start lies at the widest place of the largest connected part.
    Spaces that cannot be reached from there keep their walls but are not rooms; the world's
    notes name them. A space whose outline encloses no area is left out.

    Raises:
        InputError: The file cannot be read, is truncated or is not such a plan.
    """
    plan = _Plan(path)
    spaces = plan.spaces()
    doors = plan.doors(spaces)
    return reachable_world(
        name=path.stem,
        walls=_walls([space.outline for space in spaces.values()], [door for door, _ in doors]),
        rooms=tuple(
            Room(name=space.name, boundary=np.array(space.outline.exterior.coords[:-1]))
            for space in spaces.values()
        ),
        exits=plan.exits(spaces, doors),
        notes=tuple(plan.notes),
        source=str(path),
        robot_radius=robot_radius,
    )


def _walls(outlines: list[shapely.Polygon], doors: list[DoorOpening]) -> Segments:
    """Return the outlines, without the doors. A stretch that two outlines share appears once."""
    lines = shapely.unary_union([outline.exterior for outline in outlines])
    opened = shapely.difference(lines, shapely.unary_union([door.opening for door in doors]))
    joined = shapely.get_parts(shapely.line_merge(opened))
    # Drop points that lie on the straight line between their neighbours.
    chains = [np.array(line.coords) for line in shapely.simplify(joined, 1e-6)]
    pieces = [np.concatenate((chain[:-1], chain[1:]), axis=1) for chain in chains]
    segments = np.concatenate((*pieces, *(door.jambs for door in doors)))
    long = np.hypot(*(segments[:, 2:] - segments[:, :2]).T) > SHORTEST_WALL
    return np.compress(long, segments, axis=0)


_LARGEST = 16 << 20
"""Largest size of a plan (bytes); plans of large schools have a quarter of a million."""


class _Plan:
    """The elements of a plan's file; `notes` say what was left out or repaired."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.notes: list[str] = []
        self._left_out: set[str] = set()
        content = read_bytes(path, _LARGEST)
        try:
            self._root = ElementTree.fromstring(content)
        except ElementTree.ParseError as error:
            line, _ = error.position
            raise self._error("well-formed XML", ErrorString(error.code), f"line {line}") from None
        except (LookupError, ValueError) as error:
            raise self._error("XML in a known encoding", str(error), "line 1") from None
        if self._root.tag != "building":
            raise self._error("a floor plan <building>", f"<{self._root.tag}>", "line 1")
        floors = len(self._root.findall("floor"))
        if floors != 1:
            raise self._error("one floor", str(floors))
        self._metres_per_pixel = self._distance("real") / 100 / self._distance("represented")
        self._spaces = self._root.findall("floor/spaces/space")
        if not self._spaces:
            raise self._error("floor/spaces with at least one space", "none")
        heights = [self._pixels(point)[1] for point in self._root.iterfind(".//point")]
        widths = [self._pixels(point)[0] for point in self._root.iterfind(".//point")]
        self._left, self._bottom = min(widths), max(heights)

    def spaces(self) -> dict[str, _Space]:
        """Return the spaces by id."""
        labels = [self._label(space) for space in self._spaces]
        total, seen = Counter(labels), Counter[str]()
        spaces = {}
        for element, label in zip(self._spaces, labels, strict=True):
            seen[label] += 1
            name = label if total[label] == 1 else f"{label} {seen[label]}"
            key = element.get("id", "")
            if not key or key in spaces:
                raise self._error("a unique id", repr(key), f"space {name}")
            spaces[key] = self._space(element, name)
        enclosing = {key: space for key, space in spaces.items() if space is not None}
        if not enclosing:
            raise self._error("a space with an outline that encloses an area", "none")
        self._left_out = spaces.keys() - enclosing.keys()
        return enclosing

    def doors(self, spaces: dict[str, _Space]) -> list[tuple[DoorOpening, tuple[str, str]]]:
        """Return a door for every portal, with the names of the two spaces that it joins."""
        doors = []
        for portal in self._portals(spaces):
            first, second = (spaces[key] for key in portal.spaces)
            door = find_door(first.outline, second.outline, portal.point)
            if door is None:
                note = f"no door from {first.name} to {second.name}, which do not touch"
                self.notes.append(note)
            else:
                doors.append((door, (first.name, second.name)))
        return doors

    def exits(
        self, spaces: dict[str, _Space], doors: list[tuple[DoorOpening, tuple[str, str]]]
    ) -> tuple[Exit, ...]:
        """Return the doors as exits, without those of spaces that overlap where the door is."""
        outlines = {space.name: space.outline for space in spaces.values()}
        exits = []
        for number, (door, rooms) in enumerate(doors, 1):
            pair = np.array([[outlines[name] for name in rooms]])
            if lie_between(door.segment[np.newaxis], pair).all():
                exits.append(Exit(name=f"D{number}", segment=door.segment, rooms=rooms))
            else:
                note = f"no exit at the door D{number}: {rooms[0]} and {rooms[1]} overlap there"
                self.notes.append(note)
        return tuple(exits)

    def _portals(self, spaces: dict[str, _Space]) -> list[_Portal]:
        """Return every portal once, although both of its spaces list it."""
        points = {
            line.get("id"): shapely.Point(self._points(line)[0])
            for line in self._root.iterfind(".//linesegment[class='PORTAL']")
            if line.find("point") is not None
        }
        portals: dict[tuple[frozenset[str], shapely.Point | None], _Portal] = {}
        for element in self._root.iterfind(".//portal"):
            line = element.findtext("linesegment", "")
            ids = [target.text or "" for target in element.findall("target/id")]
            if self._left_out.intersection(ids):
                continue
            for key in ids:
                if key not in spaces:
                    raise self._error("the id of a space", repr(key), f"portal {line}")
            if len(set(ids)) != 2:
                raise self._error("two spaces", str(len(set(ids))), f"portal {line}")
            point = points.get(line)
            portals[frozenset(ids), point] = _Portal(spaces=(ids[0], ids[1]), point=point)
        placed = {pair for pair, point in portals if point is not None}
        return [
            portal
            for (pair, point), portal in portals.items()
            if point is not None or pair not in placed
        ]

    def _space(self, element: ElementTree.Element, name: str) -> _Space | None:
        """Return a space; None, with a note, if its outline encloses no area."""
        corners = self._points(element.find("bounding_polygon"))
        outline = shapely.Polygon(corners if len(corners) > 2 else ())
        if not outline.is_valid or not outline.area:
            parts = shapely.get_parts(shapely.make_valid(outline, method="structure"))
            polygons = [part for part in parts if part.geom_type == "Polygon" and part.area]
            if not polygons:
                self.notes.append(f"skipped: {name}, whose outline encloses no area")
                return None
            outline = shapely.Polygon(max(polygons, key=lambda part: float(part.area)).exterior)
            self.notes.append(f"the outline of {name} crossed itself and was cleaned")
        return _Space(name=name, outline=outline)

    def _label(self, element: ElementTree.Element) -> str:
        return element.findtext("labels/label", "").strip() or "SPACE"

    def _points(self, element: ElementTree.Element | None) -> Points:
        """Return the points of an element (m), relative to the lower left corner of the plan."""
        points = (
            [] if element is None else [self._pixels(each) for each in element.findall("point")]
        )
        pixels = np.array(points, dtype=np.float64).reshape(-1, 2)
        return self._metres_per_pixel * (pixels - (self._left, self._bottom)) * (1, -1)

    def _pixels(self, point: ElementTree.Element) -> tuple[float, float]:
        return self._number(point.get("x"), "point x"), self._number(point.get("y"), "point y")

    def _distance(self, kind: str) -> float:
        place = f"scale/{kind}_distance"
        unit = {"real": "cm", "represented": "pixel"}[kind]
        if self._root.findtext(f"{place}/um", "").strip() != unit:
            raise self._error(f"the unit {unit}", self._root.findtext(f"{place}/um", "none"), place)
        value = self._number(self._root.findtext(f"{place}/value"), place)
        if value < SHORTEST_WALL:
            raise self._error("a positive length", f"{value:g}", place)
        return value

    def _number(self, text: str | None, place: str) -> float:
        try:
            value = float(text or "")
        except ValueError:
            raise self._error("a number", repr(text or ""), place) from None
        if not abs(value) <= LARGEST:
            raise self._error(f"a finite number within ±{LARGEST:g}", repr(text), place)
        return value

    def _error(self, expected: str, found: str, place: str = "") -> InputError:
        return InputError(self._path, expected, found, place=place)


DOOR_WIDTH = 0.9
"""Width (m) of doors; plans do not state one."""

_STRAIGHT = 0.1
"""Largest deviation (m) from a straight line of a wall stretch that can hold a door."""
_NEAR = 0.15
"""Outlines whose distance is at most this much (m) above their smallest share a wall."""
_THICKEST_WALL = 0.6
"""Largest distance (m) of two outlines that share a wall."""
_OVERCUT = 0.15
"""Distance (m) by which a door is cut beyond its wall's faces, which may bend by `_STRAIGHT`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DoorOpening:
    """An opening in a wall."""

    segment: Float64[np.ndarray, "4"]
    """The line across the opening: x1, y1, x2, y2 (m)."""
    opening: shapely.Polygon
    """The area that is cut out of the walls."""
    jambs: Segments
    """The sides of the opening if the two rooms' walls lie apart; otherwise empty."""


def find_door(
    first: shapely.Polygon, second: shapely.Polygon, near: shapely.Point | None
) -> DoorOpening | None:
    """Return the door between two rooms, as close as possible to a point of their wall.

    The door stays within one straight stretch along which the rooms touch, so that it cuts no
    other wall. A stretch narrower than a door is opened completely.

    Args:
        first: One room's outline (m).
        second: The other room's outline (m).
        near: Where the door should be (m); None means the middle of the longest stretch.

    Returns:
        The door; None if the rooms do not touch.
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
    """Return the straight stretches of the first outline within `reach` (m) of the second."""
    corners = np.array(shapely.simplify(first.exterior, _STRAIGHT).coords)
    nearby = shapely.buffer(second.exterior, reach, cap_style="flat")
    sides = [shapely.LineString(side) for side in pairwise(corners)]
    parts = shapely.get_parts([side.intersection(nearby) for side in sides])
    return [part for part in parts if part.geom_type == "LineString" and part.length > reach]


def _cut(stretch: shapely.LineString, along: float, second: shapely.Polygon) -> DoorOpening:
    """Return the door in a straight stretch, centred as close as possible to length `along` (m)."""
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
    return DoorOpening(
        segment=(sides + normal * depth / 2).reshape(4),
        opening=_rectangle(sides - normal * _OVERCUT, normal * (depth + 2 * _OVERCUT)),
        jambs=np.concatenate((sides, sides + normal * depth), axis=1)[
            : 2 if depth > _OVERCUT else 0
        ],
    )


def _rectangle(side: Points, across: Float64[np.ndarray, "2"]) -> shapely.Polygon:
    return shapely.Polygon([*side, *(side[::-1] + across)])
