"""The index of walls: for every place in many buildings, the walls that matter there."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_env.sim.listing_kernels import BLOCK, Listing, list_here

CELL = 0.25
"""Side of the cells for which walls are listed (m)."""
MOST_CELLS = 16384
"""Larger buildings get larger cells."""
_UNLISTED = -1


class Walls(NamedTuple):
    """The walls of many buildings, one after another, and their lists, for compiled code."""

    walls: np.ndarray
    """(walls, 4) float64: ends x1, y1, x2, y2 (m)."""
    neighbours: np.ndarray
    """(walls, 2) int64: for either end, an end of another wall at the same point, as twice its
    number plus 0 or 1; -1 where there is none."""
    frames: np.ndarray
    """(buildings, 8) float64: the grid's corner x, y (m), cell size (m), columns and rows;
    its first cell, its first wall, and the one behind its last wall."""
    spans: np.ndarray
    """(cells, 2) int64: where in `members` a cell's list begins and ends; -1 before it is
    made. Behind each building's cells, one more stands for everywhere else, and then come the
    blocks of its cells."""
    members: np.ndarray
    """(room,) int32: walls, list after list."""
    used: np.ndarray
    """(1,) int64: how much of `members` is in use."""


class WallIndex:
    """Lists, for each cell of a grid over each building, the walls that may matter from there.

    A wall does not matter where it is out of reach or where others hide it from all of the
    cell. A cell's list is made when a robot first comes there.

    Args:
        reach: Walls farther from there than this do not matter (m).
        mount: Where on the robot the sensor is, for which walls matter: x, y (m).
        spread: How far from there it may be, where there are several (m).
        grid: Whether to list by cells at all; if not, every wall matters everywhere.
    """

    def __init__(
        self,
        reach: float,
        mount: tuple[float, float],
        *,
        spread: float = 0.0,
        grid: bool = True,
    ) -> None:
        self._reach = reach
        self._grid = grid
        self._spread = spread
        self._mount = float(mount[0]), float(mount[1])
        self.clear()

    def clear(self) -> None:
        """Forget all buildings."""
        self.most = 0
        """Walls of the building that has most."""
        self.tables = Walls(
            walls=np.empty((0, 4)),
            neighbours=np.empty((0, 2), np.int64),
            frames=np.empty((0, 8)),
            spans=np.empty((0, 2), np.int64),
            members=np.empty(1024, np.int32),
            used=np.zeros(1, np.int64),
        )

    def add(self, walls: Segments) -> int:
        """Take in a building; return its number."""
        self.most = max(self.most, len(walls))
        old = self.tables
        first = len(old.walls)
        neighbours = _neighbours(walls)
        neighbours[neighbours >= 0] += 2 * first
        grid = self._lay(walls)
        cells = grid[3] * grid[4] + 1 + math.ceil(grid[3] / BLOCK) * math.ceil(grid[4] / BLOCK)
        frame = np.array((*grid, len(old.spans), first, first + len(walls)))
        self.tables = old._replace(
            walls=np.concatenate((old.walls, walls)),
            neighbours=np.concatenate((old.neighbours, neighbours)),
            frames=np.concatenate((old.frames, frame[np.newaxis])),
            spans=np.concatenate((old.spans, np.full((cells, 2), _UNLISTED))),
        )
        return len(old.frames)

    def _lay(self, walls: Segments) -> tuple[float, float, float, int, int]:
        """Corner x, y, cell size, columns and rows of a grid over walls."""
        if not (self._grid and len(walls)):
            return 0.0, 0.0, CELL, 0, 0
        ends = walls.reshape(-1, 2)
        left, bottom = ends.min(axis=0).tolist()
        width, height = np.maximum(np.ptp(ends, axis=0), CELL).tolist()
        cell = max(CELL, math.sqrt(width * height / MOST_CELLS))
        return left, bottom, cell, math.ceil(width / cell), math.ceil(height / cell)

    def listing(self, walls: Walls) -> Listing:
        """What lists are made with; `walls` are its own `tables`."""
        return Listing(walls, float(self._reach), float(self._spread), self._mount)

    def make_room(self) -> None:
        """Let there be room for the lists of one more cell and block, whatever the building."""
        members = self.tables.members
        if len(members) - self.tables.used[0] < 2 * self.most:
            larger = np.empty(2 * (len(members) + self.most), np.int32)
            larger[: len(members)] = members
            self.tables = self.tables._replace(members=larger)


class Locator:
    """Finds out where robots are in their buildings, in two indexes at once.

    Args:
        seen: The index of what is seen.
        heard: The index of what is heard.
    """

    def __init__(self, seen: WallIndex, heard: WallIndex) -> None:
        self._seen, self._heard = seen, heard
        self._listing = ArgumentsCache(lambda a, b: (seen.listing(a), heard.listing(b)))

    def locate(
        self,
        rows: Int64[np.ndarray, "some"],
        buildings: Int64[np.ndarray, "robots"],
        poses: Float64[np.ndarray, "robots 3"],
        seeing: Int64[np.ndarray, "robots"],
        hearing: Int64[np.ndarray, "robots"],
    ) -> None:
        """Fill `seeing` and `hearing` for `rows` with the cells of robots; lists are made."""
        done = 0
        while done < len(rows):
            arguments = self._listing.arguments(self._seen.tables, self._heard.tables)
            done = list_here(rows, arguments, done, buildings, poses, seeing, hearing)
            if done < len(rows):
                self._seen.make_room()
                self._heard.make_room()


def _neighbours(walls: Segments) -> Int64[np.ndarray, "walls 2"]:
    """For either end of each wall, an end of another at the same point: 2 wall + 0 or 1, or -1."""
    found = np.full(2 * len(walls), -1)
    if len(walls):
        _, groups = np.unique(walls.reshape(-1, 2), axis=0, return_inverse=True)
        order = np.argsort(groups, kind="stable")
        for first, second in pairwise(order):
            if groups[first] == groups[second]:
                found[first], found[second] = second, first
    return found.reshape(-1, 2)
