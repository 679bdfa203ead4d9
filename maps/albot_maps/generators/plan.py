"""A floor drawn in whole centimetres: rooms carved out of the solid, furniture put back."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from albot_core.geometry.types import Segments
from albot_maps.generators.boxes import Box, Corner
from albot_maps.world import Exit, Room, World

WALL = 15
"""Thickness of a wall (cm)."""


class Plan:
    """A floor that is being drawn. Everything in it is solid until it is carved."""

    def __init__(self) -> None:
        self._floor: list[Box] = []
        self._solid: list[Box] = []
        self._outlines: list[list[Corner]] = []
        self._rooms: list[tuple[str, Box]] = []
        self._exits: list[tuple[str, Box, tuple[str, str]]] = []
        self._numbers = {"D": 0, "M": 0}

    def room(self, name: str, box: Box) -> str:
        """Carve a room, and give its name back."""
        self._rooms.append((name, box))
        self._floor.append(box)
        return name

    def carve(self, box: Box) -> None:
        """Carve a niche that belongs to no room."""
        self._floor.append(box)

    def door(self, opening: Box, rooms: tuple[str, str], *, along_x: bool) -> None:
        """Carve a doorway through a wall that runs along x, or else along y."""
        self._floor.append(opening)
        x, y = opening.middle
        line = Box(opening.x1, y, opening.x2, y) if along_x else Box(x, opening.y1, x, opening.y2)
        self._add_exit("D", line, rooms)

    def mouth(self, line: Box, rooms: tuple[str, str]) -> None:
        """Name the line where two carved rooms meet without a wall between."""
        self._add_exit("M", line, rooms)

    def block(self, box: Box) -> None:
        """Put something solid on the floor."""
        self._solid.append(box)

    def outline(self, corners: list[Corner]) -> None:
        """Put something solid of another shape on the floor, apart from all else."""
        self._outlines.append(corners)

    def world(self, name: str, source: str, start: Corner) -> World:
        """The world, once all is drawn; its start looks along x.

        Raises:
            InputError: What was drawn is no valid world.
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
        )

    def _add_exit(self, letter: str, line: Box, rooms: tuple[str, str]) -> None:
        self._numbers[letter] += 1
        self._exits.append((f"{letter}{self._numbers[letter]}", line, rooms))

    def _walls(self) -> Segments:
        """The edges of the floor, the other shapes, and the building's own outline (m)."""
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
    """The lines (n, 4) between floor and solid, each as long as it can be (cm).

    The plane is cut along all sides of all boxes; a cell of that grid is wholly floor or
    wholly solid, and an edge runs wherever two neighbours differ.
    """
    boxes = np.concatenate((floor, solid))
    xs, ys = np.unique(boxes[:, 0::2]), np.unique(boxes[:, 1::2])
    # One more cell on every side stands for the solid all round.
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
    """Line, first place and place after the last of every run of marks in a line."""
    change = np.diff(np.pad(marked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    lines, starts = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return lines, starts, ends
