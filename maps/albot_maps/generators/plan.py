"""The tools of all generators: a floor plan in whole centimetres, and random draws.

Integers give the same building on every machine. A plan is solid at first. Rooms are carved out of
it (`Box`), each with a frame of its own (`LocalFrame`); then furniture is added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Bool, Int

from albot_core.geometry.types import Segments
from albot_maps.world import Exit, Room, World

WALL = 15
"""Thickness of a wall (cm)."""


class Plan:
    """A floor plan under construction. Everything is solid until it is carved."""

    def __init__(self) -> None:
        self._floor: list[Box] = []
        self._solid: list[Box] = []
        self._outlines: list[list[Corner]] = []
        self._rooms: list[tuple[str, Box]] = []
        self._exits: list[tuple[str, Box, tuple[str, str]]] = []
        self._numbers = {"D": 0, "M": 0}

    def add_room(self, name: str, box: Box) -> str:
        """Carve a room, and return its name."""
        self._rooms.append((name, box))
        self._floor.append(box)
        return name

    def carve(self, box: Box) -> None:
        """Carve a niche that belongs to no room."""
        self._floor.append(box)

    def add_door(self, opening: Box, rooms: tuple[str, str], *, along_x: bool) -> None:
        """Carve a doorway through a wall that runs along x (`along_x`) or along y."""
        self._floor.append(opening)
        x, y = opening.middle
        line = Box(opening.x1, y, opening.x2, y) if along_x else Box(x, opening.y1, x, opening.y2)
        self._add_exit("D", line, rooms)

    def add_opening(self, line: Box, rooms: tuple[str, str]) -> None:
        """Add an exit where two carved rooms meet without a wall between."""
        self._add_exit("M", line, rooms)

    def add_block(self, box: Box) -> None:
        """Add a solid rectangle to the floor."""
        self._solid.append(box)

    def add_outline(self, corners: list[Corner]) -> None:
        """Add a solid polygon to the floor; it must not touch anything else."""
        self._outlines.append(corners)

    def world(self, name: str, source: str, start: Corner, robot_radius: float) -> World:
        """Return the finished plan as a world, with `start` facing along x.

        Raises:
            InputError: The plan is not a valid world for a robot of this radius (m).
        """
        return World(
            name=name,
            walls=self._walls(),
            starts=np.array([[start[0] / 100, start[1] / 100, 0.0]]),
            rooms=tuple(Room(name=name, boundary=_corners(box)) for name, box in self._rooms),
            exits=tuple(
                Exit(name=name, segment=np.array(line) / 100, rooms=rooms)
                for name, line, rooms in self._exits
            ),
            source=source,
            robot_radius=robot_radius,
        )

    def _add_exit(self, letter: str, line: Box, rooms: tuple[str, str]) -> None:
        self._numbers[letter] += 1
        self._exits.append((f"{letter}{self._numbers[letter]}", line, rooms))

    def _walls(self) -> Segments:
        """Return the edges of the floor, the polygons, and the building's outer walls (m)."""
        edges = _edges(
            np.array(self._floor, dtype=np.int64),
            np.array(self._solid, dtype=np.int64).reshape(-1, 4),
        )
        loops = [
            (*start, *end)
            for corners in (*self._outlines, self._facade())
            for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)
        ]
        return np.concatenate((edges, np.array(loops))).astype(np.float64) / 100

    def _facade(self) -> list[Corner]:
        low, high = np.min(self._floor, axis=0) - WALL, np.max(self._floor, axis=0) + WALL
        x1, y1, x2, y2 = int(low[0]), int(low[1]), int(high[2]), int(high[3])
        return [(x1, y1), (x2, y1), (x2, y2), (x1, y2)]


def _corners(box: Box) -> np.ndarray:
    x1, y1, x2, y2 = box
    return np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]]) / 100


def _edges(floor: Int[np.ndarray, "carved 4"], solid: Int[np.ndarray, "solid 4"]) -> np.ndarray:
    """Return the lines (n, 4) between floor and solid, each of maximal length (cm).

    All sides of all boxes divide the plane into a grid. Each cell is entirely floor or entirely
    solid, and an edge runs between two neighbours that differ.
    """
    boxes = np.concatenate((floor, solid))
    xs, ys = np.unique(boxes[:, 0::2]), np.unique(boxes[:, 1::2])
    # One extra cell on every side represents the solid around the building.
    free = np.zeros((len(xs) + 1, len(ys) + 1), dtype=bool)
    columns, rows = np.searchsorted(xs, boxes[:, 0::2]), np.searchsorted(ys, boxes[:, 1::2])
    extents = np.concatenate((columns, rows), axis=1).tolist()
    for index, (left, right, low, high) in enumerate(extents):
        free[left + 1 : right + 1, low + 1 : high + 1] = index < len(floor)
    line, start, end = _runs(free[1:] != free[:-1])
    upright = np.stack((xs[line], ys[start - 1], xs[line], ys[end - 1]), axis=1)
    line, start, end = _runs((free[:, 1:] != free[:, :-1]).T)
    level = np.stack((xs[start - 1], ys[line], xs[end - 1], ys[line]), axis=1)
    return np.concatenate((upright, level))


def _runs(
    marked: Bool[np.ndarray, "lines places"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return line, first place and place after the last of every run of marks."""
    change = np.diff(np.pad(marked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    lines, starts = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return lines, starts, ends


Corner = tuple[int, int]
"""x, y (cm)."""


class Box(NamedTuple):
    """An axis-parallel rectangle (cm)."""

    x1: int
    y1: int
    x2: int
    y2: int

    @property
    def width(self) -> int:
        """The side along x."""
        return self.x2 - self.x1

    @property
    def depth(self) -> int:
        """The side along y."""
        return self.y2 - self.y1

    @property
    def middle(self) -> Corner:
        """The centre, rounded down."""
        return (self.x1 + self.x2) // 2, (self.y1 + self.y2) // 2

    def grown(self, by: int) -> Box:
        """Return the box enlarged by `by` (cm) on every side."""
        return Box(self.x1 - by, self.y1 - by, self.x2 + by, self.y2 + by)


class Side(Enum):
    """On which side of its corridor a room lies."""

    NORTH = "north"
    SOUTH = "south"
    EAST = "east"
    WEST = "west"


@dataclass(frozen=True, kw_only=True)
class LocalFrame:
    """A room's own frame: u along its front, v away from the front, origin at a front corner."""

    box: Box
    """The room on the plan."""
    side: Side = Side.NORTH
    """On which side of its front the room lies."""

    @property
    def width(self) -> int:
        """Length of the room's front (cm)."""
        return self.box.width if self.side in (Side.NORTH, Side.SOUTH) else self.box.depth

    @property
    def depth(self) -> int:
        """Extent of the room away from its front (cm)."""
        return self.box.depth if self.side in (Side.NORTH, Side.SOUTH) else self.box.width

    def corner(self, u: int, v: int) -> Corner:
        """Return the point (u, v) of the room in the plan's frame."""
        match self.side:
            case Side.NORTH:
                return self.box.x1 + u, self.box.y1 + v
            case Side.SOUTH:
                return self.box.x1 + u, self.box.y2 - v
            case Side.EAST:
                return self.box.x1 + v, self.box.y1 + u
            case Side.WEST:
                return self.box.x2 - v, self.box.y1 + u

    def placed(self, part: Box) -> Box:
        """Return a rectangle of the room in the plan's frame."""
        (xa, ya), (xb, yb) = self.corner(part.x1, part.y1), self.corner(part.x2, part.y2)
        return Box(min(xa, xb), min(ya, yb), max(xa, xb), max(ya, yb))


Item = TypeVar("Item")

STEP = 5
"""Step of randomly drawn lengths (cm)."""


class Sampler:
    """Draw random values from uniform numbers, with arithmetic that is exact on every machine.

    Args:
        rng: Source of the uniform numbers.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._uniform = rng.random

    def integer(self, least: int, most: int) -> int:
        """Draw an integer from `least` to `most`, both included."""
        return least + int(self._uniform() * (most - least + 1))

    def length(self, least: int, most: int) -> int:
        """Draw a length (cm) from `least` to about `most`, in steps of 5 cm from `least`."""
        return least + STEP * self.integer(0, max(0, most - least) // STEP)

    def bernoulli(self, probability: float) -> bool:
        """Return True with a probability."""
        return self._uniform() < probability

    def pick(self, items: Sequence[Item]) -> Item:
        """Draw one of the items."""
        return items[self.integer(0, len(items) - 1)]

    def shuffled(self, items: Sequence[Item]) -> list[Item]:
        """Return the items in random order."""
        rest = list(items)
        return [rest.pop(self.integer(0, len(rest) - 1)) for _ in items]

    def partition(self, total: int, number: int, least: int, *, even: bool = False) -> list[int]:
        """Return `total` (cm) divided into `number` parts of at least `least`, equal if `even`.

        The last part takes what rounding leaves over.
        """
        spare = total - number * least
        weights = [1 if even else self.integer(4, 12) for _ in range(number)]
        whole = sum(weights)
        parts = [least + spare * weight // whole for weight in weights]
        parts[-1] += total - sum(parts)
        return parts
