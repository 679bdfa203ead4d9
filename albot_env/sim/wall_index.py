"""The wall index: for every place in many buildings, the walls that can be sensed there."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_env.sim.visibility import BLOCK, IndexParameters, WallTables, locate_and_list

CELL_SIZE = 0.25
"""Side of the cells for which walls are listed (m)."""
MAX_CELLS = 16384
"""Maximum number of cells of a grid; larger buildings get larger cells."""
_NOT_LISTED = -1


class WallIndex:
    """Lists, for each cell of a grid over each building, the walls that may be sensed there.

    A wall is omitted if it is out of reach or if other walls hide it from the whole cell. A
    cell's list is made when a robot first enters the cell.

    Args:
        reach: Walls farther away than this are omitted (m).
        mount: Position of the sensor on the robot, x, y (m).
        spread: Maximum distance of a sensor from `mount`, if there are several (m).
        grid: Whether to list walls by cell; if not, every wall is listed everywhere.
    """

    def __init__(
        self, reach: float, mount: tuple[float, float], *, spread: float = 0.0, grid: bool = True
    ) -> None:
        self._reach = reach
        self._gridded = grid
        self._spread = spread
        self._mount = float(mount[0]), float(mount[1])
        self.clear()

    def clear(self) -> None:
        """Forget all buildings."""
        self.max_walls = 0
        """Number of walls in the largest building."""
        self._room: dict[str, np.ndarray] = {}
        self.tables = WallTables(
            walls=np.empty((0, 4)),
            neighbours=np.empty((0, 2), np.int64),
            frames=np.empty((0, 8)),
            spans=np.empty((0, 2), np.int64),
            members=np.empty(1024, np.int32),
            used=np.zeros(1, np.int64),
        )

    def add(self, walls: Segments) -> int:
        """Add a building; return its number."""
        self.max_walls = max(self.max_walls, len(walls))
        old = self.tables
        first = len(old.walls)
        neighbours = _neighbours(walls)
        neighbours[neighbours >= 0] += 2 * first
        grid = self._grid_over(walls)
        cells = grid[3] * grid[4] + 1 + math.ceil(grid[3] / BLOCK) * math.ceil(grid[4] / BLOCK)
        frame = np.array((*grid, len(old.spans), first, first + len(walls)))
        self.tables = old._replace(
            walls=self._append("walls", walls),
            neighbours=self._append("neighbours", neighbours),
            frames=self._append("frames", frame[np.newaxis]),
            spans=self._append("spans", np.full((cells, 2), _NOT_LISTED)),
        )
        return len(old.frames)

    def _append(self, name: str, rows: np.ndarray) -> np.ndarray:
        """Return a table with more rows, which has room for as many again when it is copied."""
        old: np.ndarray = getattr(self.tables, name)
        count = len(old) + len(rows)
        room = self._room.get(name)
        if room is None or len(room) < count:
            room = self._room[name] = np.empty((2 * count, *old.shape[1:]), old.dtype)
            room[: len(old)] = old
        room[len(old) : count] = rows
        return room[:count]

    def _grid_over(self, walls: Segments) -> tuple[float, float, float, int, int]:
        """Return corner x, y, cell size, columns and rows of a grid over the walls."""
        if not (self._gridded and len(walls)):
            return 0.0, 0.0, CELL_SIZE, 0, 0
        ends = walls.reshape(-1, 2)
        left, bottom = ends.min(axis=0).tolist()
        width, height = np.maximum(np.ptp(ends, axis=0), CELL_SIZE).tolist()
        cell = max(CELL_SIZE, math.sqrt(width * height / MAX_CELLS))
        return left, bottom, cell, math.ceil(width / cell), math.ceil(height / cell)

    def parameters(self, walls: WallTables) -> IndexParameters:
        """Return the parameters that lists are made with; `walls` are its own `tables`."""
        return IndexParameters(walls, float(self._reach), float(self._spread), self._mount)

    def reserve(self) -> None:
        """Make room for the lists of one more cell and block of any building."""
        members = self.tables.members
        if len(members) - self.tables.used[0] < 2 * self.max_walls:
            larger = np.empty(2 * (len(members) + self.max_walls), np.int32)
            larger[: len(members)] = members
            self.tables = self.tables._replace(members=larger)


class Locator:
    """Finds the cells of robots in two indexes at once.

    Args:
        laser: Index of the walls that lasers see.
        sonar: Index of the walls that sonars hear.
    """

    def __init__(self, laser: WallIndex, sonar: WallIndex) -> None:
        self._laser, self._sonar = laser, sonar
        self._arguments = ArgumentsCache(lambda a, b: (laser.parameters(a), sonar.parameters(b)))

    def locate(
        self,
        rows: Int64[np.ndarray, "some"],
        buildings: Int64[np.ndarray, "robots"],
        poses: Float64[np.ndarray, "robots 3"],
        laser_cells: Int64[np.ndarray, "robots"],
        sonar_cells: Int64[np.ndarray, "robots"],
    ) -> None:
        """Fill `laser_cells` and `sonar_cells` for `rows`; list the walls of new cells."""
        done = 0
        while done < len(rows):
            arguments = self._arguments.arguments(self._laser.tables, self._sonar.tables)
            done = locate_and_list(
                rows, arguments, done, buildings, poses, laser_cells, sonar_cells
            )
            if done < len(rows):
                self._laser.reserve()
                self._sonar.reserve()


def _neighbours(walls: Segments) -> Int64[np.ndarray, "walls 2"]:
    """Return, per wall end, another wall's end at the same point: 2 wall + 0 or 1, or -1."""
    found = np.full(2 * len(walls), -1)
    if len(walls):
        _, groups = np.unique(walls.reshape(-1, 2), axis=0, return_inverse=True)
        order = np.argsort(groups, kind="stable")
        alike = groups[order[:-1]] == groups[order[1:]]
        first, second = order[:-1][alike], order[1:][alike]
        found[second] = first
        found[first] = second  # Where three meet, the one in the middle gets the last.
    return found.reshape(-1, 2)
