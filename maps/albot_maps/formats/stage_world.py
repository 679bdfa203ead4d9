"""Read Stage's `.world` files: floor plans as bitmaps, boxes and blocks.

As in Stage, a model's shape is scaled to its `size`, whatever the shape's own units, moved by its
`origin`, and then rotated and translated by its `pose`, which is relative to the model around it.
What robots touch and what their rangers see is one thing here, so a model that only rangers see
is a wall.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from jaxtyping import Bool, Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.plain_data import LARGEST
from albot_maps.formats.picture import find_picture, read_shades
from albot_maps.formats.reachable import check_coordinates, start_within
from albot_maps.formats.ros_grid import Cells, trace_cells
from albot_maps.formats.stage_text import Model, StageText, Value
from albot_maps.freespace import FreeSpace
from albot_maps.world import SHORTEST_WALL, World

_SOLID_TYPES = {"model", "floorplan"}
"""Types that are obstacles; Stage's other types are robots and their parts."""
_ROBOT = "position"
"""Stage's type of what drives."""
_STAGE_TYPES = {
    *("position", "ranger", "laser", "sonar", "sensor", "fiducial", "blobfinder", "bumper"),
    *("gripper", "camera", "ptz", "wifi", "lightindicator", "blinkenlight", "actuator", "puck"),
    *("speech", "audio", "power", "window", "gui", "block", "loadcell", "draw"),
}
"""Stage's own types that are no obstacles here."""
_DARK = 128
"""A pixel darker than this is solid."""
_SQUARE = np.array([[0.0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 0, 0]])
_DEEPEST = 50
"""Largest number of definitions that build on each other."""
_LOWEST = 0.05
"""A model that robots do not touch and that is lower than this (m) is a mark on the floor."""


def read_stage_world(path: Path, robot_radius: float) -> World:
    """Return the world in a Stage file, for a robot of this radius (m).

    Skipped, with a note each, are included files that are missing, models of the types that
    these would define, robots, and sensors. A note tells which models are walls because rangers
    see them, though robots of Stage drive through (`obstacle_return 0`). What robots touch and
    rangers do not see (`ranger_return -1`) is glass. The start is the centre of the widest place
    within walls: where the file's first robot is, else where there is most room.

    Raises:
        InputError: The file or its bitmap cannot be read, nothing in it is an obstacle, no robot
            has room, or a floor plan is neither touched nor seen, so that there is no building.
    """
    text = StageText()
    text.read(path)
    found = _Contents(text)
    for model in text.models:
        found.add(model, np.zeros(3))
    if not found.bodies:
        raise InputError(path, "a floorplan or a model that is an obstacle", found.nothing)
    if found.dropped_plan is not None and not any(body.is_plan for body in found.bodies):
        raise found.dropped_plan
    everything = np.concatenate([body.walls for body in found.bodies])
    check_coordinates(everything, path)
    start, notes = _start(FreeSpace(everything, robot_radius), found, path)
    return World(
        name=path.stem,
        walls=everything,
        glass=np.concatenate([np.full(len(body.walls), body.is_glass) for body in found.bodies]),
        starts=np.array([[*start, 0.0]]),
        notes=(*found.notes, *notes),
        source=str(path),
        robot_radius=robot_radius,
    )


def _start(
    space: FreeSpace, found: _Contents, path: Path
) -> tuple[Float64[np.ndarray, "2"], tuple[str, ...]]:
    """Return the start, in no solid body, and notes about it.

    Raises:
        InputError: No robot has room.
    """
    middles = np.array([region.representative_point().coords[0] for region in space.regions])
    solid = np.zeros(len(middles), np.bool_)
    for body in found.bodies:
        solid |= body.covers(middles)
    open_regions = [region for region, shut in zip(space.regions, solid, strict=True) if not shut]
    chosen = start_within(space, open_regions, found.homes)
    if chosen is None:
        expected = f"walls with room for a robot of radius {space.radius:g} m"
        raise InputError(path, expected, "none")
    return chosen


@dataclass
class _Contents:
    """The bodies and robots of a world, and what was skipped."""

    text: StageText
    bodies: list[_Body] = field(default_factory=list)
    """Everything that is a wall."""
    homes: list[Float64[np.ndarray, "2"]] = field(default_factory=list)
    """Positions of the robots (m)."""
    dropped_plan: InputError | None = None
    """The error for the first floor plan that nothing notices; None without one."""
    _skipped: Counter[str] = field(default_factory=Counter)
    _seen: Counter[str] = field(default_factory=Counter)
    _taken: Counter[str] = field(default_factory=Counter)

    def add(self, model: Model, frame: Pose) -> None:
        """Add a model, and the models nested in it, in the frame of the model around it."""
        body = _Body(model, self.text, frame)
        if body.kind == _ROBOT:
            self.homes.append(body.frame[:2])
        if not body.may_be_solid:
            self._skipped[model.type] += 1
            return
        if body.is_obstacle or body.is_seen:
            self.bodies.append(body)
            self._seen[model.type] += not body.is_obstacle
            self._taken[model.type] += body.kind not in _SOLID_TYPES
        else:
            self._skipped[model.type] += 1
            if body.is_plan and self.dropped_plan is None:
                self.dropped_plan = body.error("a floor plan that robots touch or rangers see")
        for part in body.parts:
            self.add(part, body.frame)

    @property
    def nothing(self) -> str:
        """What to say if nothing is an obstacle."""
        return f"none ({'; '.join(notes)})" if (notes := self.notes) else "none"

    @property
    def notes(self) -> list[str]:
        """What was skipped or assumed, one sentence each."""
        notes = [f"missing include: {name}" for name in dict.fromkeys(self.text.missing)]
        notes += dict.fromkeys(note for body in self.bodies for note in body.notes)
        for title, counts in (
            ("not defined, taken for floor plans because of their bitmaps", self._taken),
            ("walls, because rangers see them (obstacle_return 0)", self._seen),
            ("skipped (unknown or not an obstacle)", self._skipped),
        ):
            if +counts:
                listed = ", ".join(f"{count} {kind}" for kind, count in (+counts).items())
                notes.append(f"{title}: {listed}")
        return notes


class _Body:
    """A model, completed by the definitions of its type.

    Args:
        model: The model.
        text: The definitions.
        frame: Pose of the model around it.
    """

    def __init__(self, model: Model, text: StageText, frame: Pose) -> None:
        self._model = model
        self._values: dict[str, Value] = dict(model.values)
        parts = list(model.parts)
        self.kind = model.type
        """Stage's own type that it is derived from, or a type that no file defines."""
        kinds = {self.kind}
        for _ in range(_DEEPEST):
            definition = text.defined.get(self.kind)
            if definition is None:
                break
            self._values = definition.values | self._values
            parts += definition.parts
            self.kind = definition.type
            kinds.add(self.kind)
        self._blocks = [part for part in parts if part.type == "block"]
        self.parts = [part for part in parts if part.type != "block"]
        """The models nested in it."""
        self.is_plan = "bitmap" in self._values or "floorplan" in kinds
        """Whether it is a floor plan, rather than a thing."""
        self.notes: list[str] = []
        """What was assumed about its bitmap."""
        self._picture = Path()
        self._around = frame

    @property
    def may_be_solid(self) -> bool:
        """Whether it is of a type that can be an obstacle.

        A type that no file defines is one if it has a bitmap: the definition is in an include that
        is missing, and a building must not be lost.
        """
        unknown = self.kind not in _STAGE_TYPES
        return self.kind in _SOLID_TYPES or (unknown and "bitmap" in self._values)

    @property
    def is_obstacle(self) -> bool:
        """Whether robots touch it."""
        return self._values.get("obstacle_return", 1.0) != 0

    @property
    def is_seen(self) -> bool:
        """Whether rangers see a body that robots do not touch."""
        size = self._values.get("size")
        if isinstance(size, list) and _all_numbers([size]) and not self.is_plan:
            sides = np.array(size, np.float64)
            if (sides[:2] == 0).any() or (sides[2:] < _LOWEST).any():
                return False  # No body, or a mark on the floor.
        return not self._is_invisible and self._values.get("ranger_return", 1.0) != 0

    @property
    def is_glass(self) -> bool:
        """Whether rangers look through it."""
        return self.is_obstacle and self._is_invisible

    @property
    def _is_invisible(self) -> bool:
        """Whether the file says that rangers do not see it."""
        returns = self._values.get("ranger_return")
        if returns is None:  # Files for Stage 3 and earlier.
            return self._values.get("laser_return", 1.0) == 0
        return isinstance(returns, float) and returns < 0

    @cached_property
    def frame(self) -> Pose:
        """Its pose in the world."""
        pose = self._numbers("pose", (3, 4), [0.0, 0.0, 0.0])
        return compose(self._around, np.array([pose[0], pose[1], np.deg2rad(pose[-1])]))

    @cached_property
    def walls(self) -> Segments:
        """Its outline in the world (m)."""
        middle, factor = self._scale
        scaled = ((self._outline.reshape(-1, 2) - middle) * factor).reshape(-1, 4)
        return transform_segments(self._place, scaled)

    def covers(self, points: Points) -> Bool[np.ndarray, "points"]:
        """Return which points (m) lie inside the solid parts of its shape."""
        middle, factor = self._scale
        x, y = (transform_points(inverse(self._place), points) / factor + middle).T
        if self._dark is not None:
            rows, columns = self._dark.shape
            column, row = np.floor(x).astype(int), np.floor(y).astype(int)
            on = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            return np.asarray(on & self._dark[row * on, column * on])
        lines = self._polygons or [_SQUARE[:, :2]]
        solid = shapely.union_all([shapely.make_valid(shapely.Polygon(line)) for line in lines])
        return np.asarray(shapely.contains_xy(solid, x, y))

    @cached_property
    def _place(self) -> Pose:
        """Pose of the middle of its shape in the world."""
        origin = self._numbers("origin", (2, 3, 4), [0.0, 0.0, 0.0])
        turn = np.deg2rad(origin[-1]) if len(origin) > 2 else 0.0
        return compose(self.frame, np.array([origin[0], origin[1], turn]))

    @cached_property
    def _scale(self) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """The middle of its shape in the shape's own units, and the metres that a unit has."""
        corners = self._outline.reshape(-1, 2)
        low, high = corners.min(axis=0), corners.max(axis=0)
        if (high - low <= SHORTEST_WALL).any():
            raise self._error("a shape with an area", "a line")
        size = self._numbers("size", (2, 3), [1.0, 1.0])[:2]
        if (size <= 0).any():
            raise self._error("a size larger than 0", str(size.tolist()))
        return (low + high) / 2, size / (high - low)

    @cached_property
    def _outline(self) -> Segments:
        """Its outline in the shape's own units."""
        if self._dark is not None:
            # With `boundary 1`, the picture's edge is a wall, too.
            edge = _SQUARE * np.array([self._dark.shape[::-1] * 2])
            traced = trace_cells(self._dark, self._picture)
            bounded = self._values.get("boundary", 0.0) == 1
            return np.concatenate((traced, edge)) if bounded else traced
        if not self._polygons:
            return _SQUARE
        return np.concatenate(
            [np.concatenate((line, np.roll(line, -1, axis=0)), axis=1) for line in self._polygons]
        )

    @cached_property
    def _dark(self) -> Cells | None:
        """The dark pixels of its bitmap, the lowest row first; None without a bitmap."""
        name = self._values.get("bitmap")
        if name is None:
            return None
        found = find_picture(self._model.path.parent, str(name))
        if found is None:
            raise self._error("a picture that exists", repr(name), "bitmap")
        picture, note = found
        self._picture = picture
        self.notes += [note] if note else []
        dark = read_shades(picture)[::-1] < _DARK
        if not dark.any():
            raise InputError(picture, "at least one dark pixel", "none")
        return dark

    @cached_property
    def _polygons(self) -> list[Points]:
        """The outlines of its blocks."""
        return [_block_outline(block) for block in self._blocks]

    def _numbers(self, key: str, lengths: tuple[int, ...], otherwise: list[float]) -> np.ndarray:
        row = self._values.get(key, list(otherwise))
        if not isinstance(row, list) or len(row) not in lengths or not _all_numbers([row]):
            expected = f"{key} with {' or '.join(map(str, lengths))} numbers"
            raise self._error(expected, str(row))
        return np.array(row, dtype=np.float64)

    def error(self, expected: str) -> InputError:
        """Return the error for what nothing notices; it names the properties that say so."""
        keys = ("obstacle_return", "ranger_return", "laser_return")
        said = [f"{key} {self._values[key]:g}" for key in keys if self._is_number(key)]
        return self._error(expected, f"{self._model.type} with {' and '.join(said)}")

    def _is_number(self, key: str) -> bool:
        return isinstance(self._values.get(key), float)

    def _error(self, expected: str, found: str, key: str = "") -> InputError:
        place = f"line {self._model.line}" + (f", {key}" if key else "")
        return InputError(self._model.path, expected, found, place=place)


def _block_outline(block: Model) -> Points:
    points = [value for key, value in block.values.items() if key.startswith("point[")]
    rows = [row for row in points if isinstance(row, list) and len(row) == 2]
    if len(rows) != len(points) or len(rows) < 3 or not _all_numbers(rows):
        expected = "3 points or more of 2 numbers each"
        raise InputError(block.path, expected, place=f"line {block.line}")
    return np.array(rows, dtype=np.float64)


def _all_numbers(rows: Iterable[Sequence[str | float]]) -> bool:
    return all(isinstance(item, float) and abs(item) <= LARGEST for row in rows for item in row)
