"""Read Stage's `.world` files: floor plans as bitmaps, boxes and blocks.

The syntax is that of https://player-stage-manual.readthedocs.io: `include "file"`,
`define NAME TYPE ( … )`, `TYPE ( … )` and `property value`. A value is a number, a quoted
text, or a row of these in square brackets; `#` begins a comment.

As in Stage, a model's shape is scaled to its `size`, whatever the shape's own units, then
rotated and translated by its `pose`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_core.files import exists, read_bytes
from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.plain_data import LARGEST
from albot_maps.formats.reachable import check_coordinates
from albot_maps.formats.ros_grid import read_shades, trace_cells
from albot_maps.freespace import FreeSpace
from albot_maps.world import ROBOT_RADIUS, SHORTEST_WALL, World

Value = str | float | list[str | float]
"""Value of a property."""

_TOKEN = re.compile(
    r"""(?P<skip>[ \t\r]+|\#[^\n]*)|(?P<line>\n)|"(?P<text>[^"\n]*)"|(?P<mark>[()\[\]])
    |(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]))
    |(?P<word>[A-Za-z_][\w.\-]*(?:\[\d+\])?)""",
    re.VERBOSE,
)
_DEEPEST_NESTING = 50
"""Largest depth of nested includes, and of nested models."""
_SOLID_TYPES = {"model", "floorplan"}
"""Types that are obstacles; Stage's other types are robots and their parts."""
_DARK = 128
"""A pixel darker than this is solid."""
_SQUARE = np.array([[0.0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 0, 0]])
_LARGEST = 4 << 20
"""Largest size of a file (bytes); real worlds have a few thousand."""
_DEEPEST = 50
"""Largest number of definitions that build on each other."""


def read_stage_world(path: Path) -> World:
    """Return the world in a Stage file.

    Skipped, with a note each, are included files that are missing, models of the types that
    these would define, robots, and sensors. The start is the centre of the widest place in the
    largest region that walls enclose.

    Raises:
        InputError: The file or its bitmap cannot be read, or nothing in it is an obstacle.
    """
    text = StageText()
    text.read(path)
    walls, left_out = [], Counter[str]()
    notes = [f"missing include: {name}" for name in dict.fromkeys(text.missing)]
    for model in text.models:
        solid = _Solid(model, text)
        if solid.is_obstacle:
            walls.append(solid.walls())
            notes += solid.notes
        else:
            left_out[model.type] += 1
    if not walls:
        raise InputError(path, "a floorplan or a model that is an obstacle", "none")
    if left_out:
        listed = ", ".join(f"{count} {kind}" for kind, count in left_out.items())
        notes.append(f"skipped (unknown or not an obstacle): {listed}")
    everything = np.concatenate(walls)
    check_coordinates(everything, path)
    return World(
        name=path.stem,
        walls=everything,
        starts=_start(everything, path),
        notes=tuple(notes),
        source=str(path),
    )


def _start(walls: Segments, path: Path) -> np.ndarray:
    """Return the centre of the widest place in the largest region that walls enclose."""
    space = FreeSpace(walls, ROBOT_RADIUS)
    closed = [region for region in space.regions if space.encloses(region)]
    if not closed:
        raise InputError(path, f"walls that enclose a robot of radius {ROBOT_RADIUS} m", "none")
    widest = max(closed, key=lambda region: float(region.area))
    x, y = shapely.maximum_inscribed_circle(widest, tolerance=0.05).coords[0]
    return np.array([[round(x, 2), round(y, 2), 0.0]])


class _Solid:
    """A model, completed by the definitions of its type."""

    def __init__(self, model: Model, text: StageText) -> None:
        self._model = model
        self._values: dict[str, Value] = dict(model.values)
        self._blocks = [part for part in model.parts if part.type == "block"]
        self.notes: list[str] = []
        kind = model.type
        for _ in range(_DEEPEST):
            definition = text.defined.get(kind)
            if definition is None:
                break
            self._values = definition.values | self._values
            self._blocks += [part for part in definition.parts if part.type == "block"]
            kind = definition.type
        self._kind = kind

    @property
    def is_obstacle(self) -> bool:
        """Whether it is an obstacle."""
        return self._kind in _SOLID_TYPES and self._values.get("obstacle_return", 1.0) != 0

    def walls(self) -> Segments:
        """Return its outline in the world (m)."""
        shape = self._shape()
        corners = shape.reshape(-1, 2)
        low, high = corners.min(axis=0), corners.max(axis=0)
        if (high - low <= SHORTEST_WALL).any():
            raise self._error("a shape with an area", "a line")
        size = self._numbers("size", (2, 3), [1.0, 1.0])[:2]
        if (size <= 0).any():
            raise self._error("a size larger than 0", str(size.tolist()))
        pose = self._numbers("pose", (3, 4), [0.0, 0.0, 0.0])
        stretched = ((corners - (low + high) / 2) * size / (high - low)).reshape(-1, 4)
        turned = np.array([pose[0], pose[1], np.deg2rad(pose[-1])])
        return transform_segments(turned, stretched)

    def _shape(self) -> Segments:
        """Return its outline in the shape's own units."""
        if "bitmap" in self._values:
            return self._bitmap(str(self._values["bitmap"]))
        if not self._blocks:
            return _SQUARE
        outlines = [self._outline(block) for block in self._blocks]
        return np.concatenate(
            [np.concatenate((points, np.roll(points, -1, axis=0)), axis=1) for points in outlines]
        )

    def _bitmap(self, name: str) -> Segments:
        """Return the outlines of the dark pixels; with `boundary 1`, the picture's edge too."""
        folder = self._model.path.parent
        picture = folder / name
        beside = folder / Path(name).name
        if not exists(picture) and exists(beside):
            self.notes.append(f"{name} is missing; used {beside.name}")
            picture = beside
        if not exists(picture) or picture.is_dir():
            raise self._error("a picture that exists", repr(name), "bitmap")
        dark = read_shades(picture)[::-1] < _DARK
        if not dark.any():
            raise InputError(picture, "at least one dark pixel", "none")
        edge = _SQUARE * np.array([dark.shape[::-1] * 2])
        bounded = self._values.get("boundary", 0.0) == 1
        traced = trace_cells(dark, picture)
        return np.concatenate((traced, edge)) if bounded else traced

    def _outline(self, block: Model) -> np.ndarray:
        points = [value for key, value in block.values.items() if key.startswith("point[")]
        rows = [row for row in points if isinstance(row, list) and len(row) == 2]
        if len(rows) != len(points) or len(rows) < 3 or not _all_numbers(rows):
            raise InputError(
                block.path, "3 points or more of 2 numbers each", place=f"line {block.line}"
            )
        return np.array(rows, dtype=np.float64)

    def _numbers(self, key: str, lengths: tuple[int, ...], otherwise: list[float]) -> np.ndarray:
        row = self._values.get(key, list(otherwise))
        if not isinstance(row, list) or len(row) not in lengths or not _all_numbers([row]):
            expected = f"{key} with {' or '.join(map(str, lengths))} numbers"
            raise self._error(expected, str(row))
        return np.array(row, dtype=np.float64)

    def _error(self, expected: str, found: str, key: str = "") -> InputError:
        place = f"line {self._model.line}" + (f", {key}" if key else "")
        return InputError(self._model.path, expected, found, place=place)


def _all_numbers(rows: list[list[str | float]]) -> bool:
    return all(isinstance(item, float) and abs(item) <= LARGEST for row in rows for item in row)


@dataclass(kw_only=True)
class Model:
    """A model as written in the file."""

    type: str
    """Its type: one of Stage's own, or one that a file defines."""
    path: Path
    """The file that contains it."""
    line: int
    """Line at which it begins."""
    values: dict[str, Value] = field(default_factory=dict)
    """Its properties."""
    parts: list[Model] = field(default_factory=list)
    """The models nested in it."""


@dataclass
class StageText:
    """A Stage world file and the files that it includes."""

    models: list[Model] = field(default_factory=list)
    """The models of the world."""
    defined: dict[str, Model] = field(default_factory=dict)
    """The types that files define, by name."""
    missing: list[str] = field(default_factory=list)
    """Included files that are missing."""

    def read(self, path: Path, depth: int = 0) -> None:
        """Add the content of a file.

        Raises:
            InputError: The file cannot be read, or has a syntax error.
        """
        if depth > _DEEPEST_NESTING:
            raise InputError(path, f"files included {_DEEPEST_NESTING} deep at most", "more")
        parser = _Parser(path)
        while (token := parser.next()) is not None:
            if token.text == "include" and token.kind == "word":
                _, name, line = parser.expect("text", "the name of a file")
                included = path.parent / name
                if not exists(included):
                    self.missing.append(name)
                elif included.is_dir():
                    place = f"line {line}, include"
                    raise InputError(path, "a file, not a folder", repr(name), place=place)
                else:
                    self.read(included, depth + 1)
            elif token.text == "define" and token.kind == "word":
                name = parser.expect("word", "a name").text
                self.defined[name] = parser.model(parser.expect("word", "a type"))
            elif (model := parser.model_or_value(token, {}, 0)) is not None:
                self.models.append(model)


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


class _Parser:
    """A parser of one file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            text = read_bytes(path, _LARGEST).decode()
        except UnicodeDecodeError as error:
            found = f"the byte 0x{error.object[error.start]:02x}"
            raise InputError(path, "UTF-8 text", found) from None
        self._tokens = list(self._split(text))
        self._position = 0

    def next(self) -> _Token | None:
        """Return the next token; None at the end."""
        if self._position == len(self._tokens):
            return None
        self._position += 1
        return self._tokens[self._position - 1]

    def expect(self, kind: str, what: str) -> _Token:
        """Return the next token; raise InputError if it is not of `kind`."""
        token = self.next()
        if token is None or token.kind != kind:
            raise self._error(what, token)
        return token

    def model(self, token: _Token, depth: int = 0) -> Model:
        """Return the model whose type is `token`, parsed from its `(` to its `)`."""
        if depth > _DEEPEST_NESTING:
            raise self._error(f"models nested {_DEEPEST_NESTING} deep at most", token)
        model = Model(type=token.text, path=self._path, line=token.line)
        opened = self.next()
        if opened is None or opened.text != "(":
            raise self._error("(", opened)
        while (inner := self.next()) is None or inner.text != ")" or inner.kind != "mark":
            if inner is None:
                raise self._error(f"a ) for the ( of line {opened.line}", None)
            part = self.model_or_value(inner, model.values, depth)
            if part is not None:
                model.parts.append(part)
        return model

    def model_or_value(self, token: _Token, values: dict[str, Value], depth: int) -> Model | None:
        """Return the model that begins with `token`; None after storing a property in `values`."""
        if token.kind != "word":
            raise self._error("a model or a property", token)
        following = self.next()
        if following is not None and following.kind == "mark" and following.text == "(":
            self._position -= 1
            return self.model(token, depth + 1)
        values[token.text] = self._value(following)
        return None

    def _value(self, token: _Token | None) -> Value:
        if token is None or (token.kind == "mark" and token.text != "["):
            raise self._error("a value", token)
        if token.kind != "mark":
            return float(token.text) if token.kind == "number" else token.text
        row: list[str | float] = []
        while (item := self.next()) is not None and item.kind != "mark":
            row.append(float(item.text) if item.kind == "number" else item.text)
        if item is None or item.text != "]":
            raise self._error("]", item)
        return row

    def _split(self, text: str) -> Iterator[_Token]:
        position, line = 0, 1
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None:
                raise self._error("Stage's syntax", _Token("", text[position], line))
            kind = str(match.lastgroup)
            if kind == "line":
                line += 1
            elif kind != "skip":
                yield _Token(kind, match[kind], line)
            position = match.end()

    def _error(self, expected: str, found: _Token | None) -> InputError:
        place = f"line {found.line}" if found else "end of the file"
        return InputError(self._path, expected, repr(found.text) if found else "", place=place)
