"""Reading our own world file: YAML, `albot-world` version 1 (docs/worlds.md)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Segments
from albot_maps.formats.world_movables import MovablesReader
from albot_maps.formats.world_schema import check_schema
from albot_maps.formats.yaml_document import YamlDocument, shown
from albot_maps.world import LARGEST_COORDINATE, METRES, SHORTEST_WALL, Exit, Room, World


def parse_world(text: str, *, source: str) -> World:
    """The world in the text of an `albot-world` file; `source` names it in errors.

    Raises:
        InputError: The text is no such file or holds an invalid world; with the line.
    """
    return world_from_document(YamlDocument(text, source), source=source)


def world_from_document(document: YamlDocument, *, source: str) -> World:
    """The world in the document of an `albot-world` file; raises as `parse_world` does."""
    check_schema(document, source)
    data = document.data
    walls = _Walls(document, source)
    starts = [_start(start) for start in data["starts"]]
    walls.check_outside_solids(starts)
    movables = MovablesReader(document, source).read()
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
        )
    except InputError as error:
        place = document.place(_path_in_file(error.place, data))
        raise InputError(source, error.expected, error.found, place=place) from None


class _Walls:
    """The wall segments that a document draws, in the order in which it draws them."""

    def __init__(self, document: YamlDocument, source: str) -> None:
        self._document = document
        self._source = source
        self._solids: list[tuple[tuple[str | int, ...], Points]] = []
        pieces = [np.empty((0, 4)), *self._pieces(document.data)]
        panes = [np.empty((0, 4)), *self._lines("glass", document.data)]
        self.segments: Segments = np.concatenate([*pieces, *panes])
        self.glass = np.arange(len(self.segments)) >= sum(map(len, pieces))

    def check_outside_solids(self, starts: Sequence[Pose]) -> None:
        """Raise InputError where a start lies inside a box or polygon."""
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
                raise self._error(("boxes", index), expected, shown(box))
            corners = [[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]]
            yield self._solid(("boxes", index), _points(corners))
        for index, outline in enumerate(data.get("polygons", ())):
            yield self._solid(("polygons", index), _points(outline))

    def _solid(self, path: tuple[str | int, ...], corners: Points) -> Segments:
        segments = self._joined(path, np.concatenate((corners, corners[:1])))
        if not shapely.LinearRing(corners).is_simple or shapely.Polygon(corners).area == 0.0:
            found = "sides that cross or touch each other"
            raise self._error(path, "an outline around some ground", found)
        self._solids.append((path, corners))
        return segments

    def _joined(self, path: tuple[str | int, ...], points: Points) -> Segments:
        """The segments between consecutive points, checked here where the line is known."""
        for index in np.flatnonzero(~(np.abs(points) <= LARGEST_COORDINATE).all(axis=1)):
            found = shown(points[index].tolist())
            raise self._error((*path, int(index)), METRES, found)
        for index in np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) <= SHORTEST_WALL):
            place = (*path, int(index)) if path[0] in ("walls", "glass") else path
            found = f"the point {shown(points[index].tolist())} twice"
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
    """The path in the file to a place of the model: rooms and exits go by name there."""
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
