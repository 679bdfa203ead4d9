"""Read and write `albot-world` files, version 1: YAML, described in docs/worlds.md.

A document is checked against the JSON Schema beside this file; then the world made from it is
checked like every world. Each error names the line. Reading a written world gives the same world.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, TypeVar, cast

import jsonschema
import numpy as np
import shapely
import yaml
from jsonschema.exceptions import ValidationError, best_match

from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.yaml_document import YamlDocument, format_value
from albot_maps.movables import (
    LARGEST_OPENING,
    SMALLEST_OPENING,
    Box,
    Door,
    Movables,
    Walker,
)
from albot_maps.world import (
    LARGEST_COORDINATE,
    METRES,
    ROBOT_RADIUS,
    SHORTEST_WALL,
    Exit,
    Room,
    World,
)

Thing = TypeVar("Thing", Door, Box, Walker)

_VERSION = 1
_ANGLES = ("heading", "opening")
"""Fields in degrees; `heading_rad` and `opening_rad` are in radians."""
_LEAST, _MOST = f"{np.rad2deg(SMALLEST_OPENING):.2f}", f"{np.rad2deg(LARGEST_OPENING):g}"
_OPENING = f"an angle from {_LEAST} to {_MOST} degrees, or from -{_MOST} to -{_LEAST} degrees"
"""What is expected of a door's `opening`, which the file has in degrees."""


def parse_world(text: str, *, source: str, robot_radius: float = ROBOT_RADIUS) -> World:
    """Return the world in the text of an `albot-world` file; `source` names the text in errors.

    It is checked for a robot of this radius (m).

    Raises:
        InputError: The text is not such a file, or its world is invalid; the place is the line.
    """
    document = YamlDocument(text, source)
    check_schema(document, source)
    return world_from_document(document, source=source, robot_radius=robot_radius)


def world_from_document(
    document: YamlDocument, *, source: str, robot_radius: float = ROBOT_RADIUS
) -> World:
    """Return the world in the document of an `albot-world` file; raises as `parse_world` does.

    The document follows the schema (`check_schema`), and does not change.
    """
    data = document.data
    walls = _Walls(document, source)
    starts = [_start(start) for start in data["starts"]]
    walls.check_outside_solids(starts)
    movables = _movables(document, source)
    try:
        return World(
            name=data["name"],
            walls=walls.segments,
            glass=walls.glass,
            starts=np.array(starts),
            rooms=tuple(
                Room(name=name, boundary=_points(outline))
                for name, outline in data.get("rooms", {}).items()
            ),
            exits=tuple(
                Exit(
                    name=name,
                    segment=_points(opening["line"]).reshape(4),
                    rooms=(opening["rooms"][0], opening["rooms"][1]),
                )
                for name, opening in data.get("exits", {}).items()
            ),
            tours={name: _points(line) for name, line in data.get("tours", {}).items()},
            notes=tuple(data.get("notes", ())),
            movables=movables,
            source=source,
            robot_radius=robot_radius,
        )
    except InputError as error:
        place = document.place(_path_in_file(error.place, data))
        raise InputError(source, error.expected, error.found, place=place) from None


def world_text(world: World) -> str:
    """Return a world as the text of an `albot-world` file, which reads back as the same world.

    Chains of walls are written as polylines, glass last. The world's `source` is not written.
    """
    lines = [f"albot-world: {_VERSION}", f"name: {_quoted(world.name)}"]
    sections = {
        "notes": [f"- {_quoted(note)}" for note in world.notes],
        "walls": [f"- {format_array(line)}" for line in _chains(world.opaque)],
        "glass": [f"- {format_array(line)}" for line in _chains(world.walls[world.glass])],
        "rooms": [f"{_quoted(room.name)}: {format_array(room.boundary)}" for room in world.rooms],
        "exits": [
            f"{_quoted(opening.name)}: {{line: {format_array(opening.segment.reshape(2, 2))}, "
            f"rooms: [{', '.join(map(_quoted, opening.rooms))}]}}"
            for opening in world.exits
        ],
        "starts": [
            f"- {{at: {format_array(start[:2])}, {format_angle('heading', float(start[2]))}}}"
            for start in world.starts
        ],
        "tours": [f"{_quoted(name)}: {format_array(line)}" for name, line in world.tours.items()],
        "movables": _movable_lines(world.movables),
    }
    for name, entries in sections.items():
        if entries:
            lines += ["", f"{name}:", *(f"  {entry}" for entry in entries)]
    return "\n".join(lines) + "\n"


def check_schema(document: YamlDocument, source: str) -> None:
    """Check a document against the schema of `albot-world` files.

    Raises:
        InputError: It does not follow the schema; the place is the line.
    """
    data = document.data
    if not isinstance(data, dict):
        found = "nothing" if data is None else format_value(data)
        raise InputError(source, "a YAML mapping with the key albot-world", found, place="line 1")
    if "albot-world" not in data:
        found = ", ".join(data) or "none"
        raise InputError(source, "the key albot-world", f"the keys {found}", place="line 1")
    version = data["albot-world"]
    if version != _VERSION or isinstance(version, bool):
        # Before all else: the keys of another version are not known here.
        expected, place = f"version {_VERSION} of the format", document.place(("albot-world",))
        raise InputError(source, expected, format_value(version), place=place)
    error = best_match(_validator().iter_errors(data), key=_rank)
    if error is not None:
        path, expected, found = _explained(error)
        raise InputError(source, expected, found, place=document.place(path))


@cache
def _validator() -> jsonschema.Draft202012Validator:
    file = resources.files("albot_maps.formats") / "albot-world.schema.json"
    return jsonschema.Draft202012Validator(json.loads(file.read_text(encoding="utf-8")))


def _rank(error: ValidationError) -> tuple[int, bool]:
    """Return the key for `best_match`: shallow errors first, unknown keys first at each depth."""
    return -len(error.absolute_path), error.validator == "additionalProperties"


def _explained(error: ValidationError) -> tuple[list[str | int], str, str]:
    """Return an error's path, what was expected there, and what was found."""
    path = list(error.absolute_path)
    schema = cast("Mapping[str, Any]", error.schema)
    keys: dict[str, Any] = error.instance if isinstance(error.instance, dict) else {}
    if error.validator == "additionalProperties":
        known = list(schema["properties"])
        unknown = next(key for key in keys if key not in known)
        found = f"{unknown}{did_you_mean(unknown, known)}"
        return [*path, unknown], f"one of the keys {', '.join(known)}", found
    if error.validator == "required":
        missing = next(key for key in schema["required"] if key not in keys)
        return path, f"the key {missing}", f"only {', '.join(keys) or 'an empty mapping'}"
    return path, schema["description"], format_value(error.instance)


class _Walls:
    """The wall segments of a document, in its order."""

    def __init__(self, document: YamlDocument, source: str) -> None:
        self._document = document
        self._source = source
        self._solids: list[tuple[tuple[str | int, ...], Points]] = []
        pieces = [np.empty((0, 4)), *self._pieces(document.data)]
        panes = [np.empty((0, 4)), *self._lines("glass", document.data)]
        self.segments: Segments = np.concatenate([*pieces, *panes])
        self.glass = np.arange(len(self.segments)) >= sum(map(len, pieces))

    def check_outside_solids(self, starts: Sequence[Pose]) -> None:
        """Raise InputError if a start lies inside a box or polygon."""
        for path, corners in self._solids:
            solid = shapely.Polygon(corners)
            for index, start in enumerate(starts):
                if solid.intersects(shapely.Point(start[:2])):
                    place = self._document.place(("starts", index))
                    found = f"the inside of {self._document.place(path)}"
                    raise InputError(self._source, "a start in free space", found, place=place)

    def _lines(self, key: str, data: dict[str, Any]) -> Iterator[Segments]:
        for index, line in enumerate(data.get(key, ())):
            yield self._joined((key, index), _points(line))

    def _pieces(self, data: dict[str, Any]) -> Iterator[Segments]:
        yield from self._lines("walls", data)
        for index, box in enumerate(data.get("boxes", ())):
            x_min, y_min, x_max, y_max = box
            if not (x_min < x_max and y_min < y_max):
                expected = "x_min, y_min, x_max, y_max with x_min < x_max and y_min < y_max"
                raise self._error(("boxes", index), expected, format_value(box))
            corners = [[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]]
            yield self._solid(("boxes", index), _points(corners))
        for index, outline in enumerate(data.get("polygons", ())):
            yield self._solid(("polygons", index), _points(outline))

    def _solid(self, path: tuple[str | int, ...], corners: Points) -> Segments:
        segments = self._joined(path, np.concatenate((corners, corners[:1])))
        if not shapely.LinearRing(corners).is_simple or shapely.Polygon(corners).area == 0.0:
            found = "sides that cross or touch each other"
            raise self._error(path, "an outline that encloses an area", found)
        self._solids.append((path, corners))
        return segments

    def _joined(self, path: tuple[str | int, ...], points: Points) -> Segments:
        """Return the segments between consecutive points, checked here, where the line is known."""
        for index in np.flatnonzero(~(np.abs(points) <= LARGEST_COORDINATE).all(axis=1)):
            found = format_value(points[index].tolist())
            raise self._error((*path, int(index)), METRES, found)
        for index in np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) <= SHORTEST_WALL):
            place = (*path, int(index)) if path[0] in ("walls", "glass") else path
            found = f"the point {format_value(points[index].tolist())} twice"
            raise self._error(place, "a wall longer than 0", found)
        return np.concatenate((points[:-1], points[1:]), axis=1)

    def _error(self, path: Sequence[str | int], expected: str, found: str) -> InputError:
        return InputError(self._source, expected, found, place=self._document.place(path))


def _points(rows: list[Any]) -> Points:
    return np.array(rows, dtype=np.float64)


def _start(start: dict[str, Any]) -> Pose:
    heading = start["heading_rad"] if "heading_rad" in start else np.deg2rad(start["heading"])
    return np.array([*start["at"], heading], dtype=np.float64)


def _path_in_file(place: str, data: dict[str, Any]) -> list[str | int]:
    """Return the path in the file of a place of the world; files list rooms and exits by name."""
    kind, _, rest = place.partition("[")
    if kind.startswith("tours."):
        return ["tours", kind.removeprefix("tours.")]
    if not rest:
        return [kind]
    index = int(rest.partition("]")[0])
    if kind.startswith("movables."):
        return ["movables", kind.removeprefix("movables."), index]
    keys = list(data[kind]) if isinstance(data.get(kind), dict) else None
    return [kind, keys[index] if keys else index]


def _movables(document: YamlDocument, source: str) -> Movables:
    """Return the movables; raise InputError, with the line, if a number is out of range."""

    def read(key: str, make: Callable[..., Thing]) -> tuple[Thing, ...]:
        things = []
        for index, entry in enumerate(document.data.get("movables", {}).get(key, ())):
            try:
                things.append(make(**_fields(entry)))
            except InputError as error:
                name = next((name for name in entry if name.startswith(error.place)), error.place)
                place = document.place(("movables", key, index, name))
                expected, found = error.expected, error.found
                if name == "opening":
                    expected, found = _OPENING, format_value(entry[name])
                raise InputError(source, expected, found, place=place) from None
        return tuple(things)

    return Movables(
        doors=read("doors", Door), boxes=read("boxes", Box), walkers=read("walkers", Walker)
    )


def _fields(entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry's values as the fields of a movable: lists as tuples, angles in radians."""
    fields = {name: _tuples(value) for name, value in entry.items()}
    for name in _ANGLES:
        if name in fields:
            fields[name] = float(np.deg2rad(fields[name]))
        if f"{name}_rad" in fields:
            fields[name] = fields.pop(f"{name}_rad")
    return fields


def _tuples(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(map(_tuples, value))
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _movable_lines(movables: Movables) -> list[str]:
    """Return the lines of the section `movables`, indented relative to it."""
    parts = {
        "doors": [_door(door) for door in movables.doors],
        "boxes": [_box(box) for box in movables.boxes],
        "walkers": [_walker(walker) for walker in movables.walkers],
    }
    return [
        line
        for name, entries in parts.items()
        if entries
        for line in (f"{name}:", *(f"  - {{{entry}}}" for entry in entries))
    ]


def _door(door: Door) -> str:
    parts = [
        f"hinge: {_pair(door.hinge)}",
        format_angle("heading", door.heading),
        f"width: {format_number(door.width)}",
        format_angle("opening", door.opening),
        f"turn_rate: {format_number(door.turn_rate)}",
        f"open_for: {_pair(door.open_for)}",
        f"shut_for: {_pair(door.shut_for)}",
    ]
    return ", ".join(parts)


def _box(box: Box) -> str:
    parts = [f"at: {_pair(box.at)}", format_angle("heading", box.heading)]
    parts += [
        f"{name}: {format_number(getattr(box, name))}" for name in ("length", "width", "mass")
    ]
    return ", ".join(parts)


def _walker(walker: Walker) -> str:
    closed = "true" if walker.closed else "false"
    route, speed = format_array(np.array(walker.route)), _pair(walker.speed)
    radius = format_number(walker.radius)
    return f"route: {route}, closed: {closed}, speed: {speed}, radius: {radius}"


def _pair(values: tuple[float, float]) -> str:
    return format_array(np.array(values))


def _chains(walls: Segments) -> Iterator[Points]:
    """Yield the chains of walls in which each wall begins where the previous one ends."""
    if not len(walls):
        return
    breaks = np.flatnonzero((walls[1:, :2] != walls[:-1, 2:]).any(axis=1)) + 1
    for run in np.split(walls, breaks):
        yield np.concatenate((run[:1, :2], run[:, 2:]))


def _quoted(text: str) -> str:
    if text.replace("-", "").replace("_", "").isalnum() and text.isascii() and text[0].isalpha():
        return text if text.lower() not in {"true", "false", "null"} else f'"{text}"'
    dumped = yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**9)
    return str(dumped).strip()


def format_array(values: np.ndarray) -> str:
    """Return an array in YAML's flow style: `[[0, 1.5], [2, 3]]`."""
    if values.ndim > 1:
        return f"[{', '.join(map(format_array, values))}]"
    return f"[{', '.join(map(format_number, values.tolist()))}]"


def format_number(value: float) -> str:
    """Return a number as text that reads back as the same number."""
    return repr(float(value)).removesuffix(".0")


def format_angle(name: str, radians: float) -> str:
    """Return `name` in degrees if these give exactly the same angle, otherwise `name_rad`."""
    degrees = float(np.rad2deg(radians))
    for candidate in (round(degrees, 6), degrees):
        if np.deg2rad(candidate) == radians:
            return f"{name}: {format_number(candidate)}"
    return f"{name}_rad: {format_number(radians)}"
