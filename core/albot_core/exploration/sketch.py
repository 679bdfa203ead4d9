"""The sketch: where the robot has seen free ground and obstacles, and what it has covered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int

from albot_core.exploration.senses import Senses
from albot_core.exploration.sketch_kernels import BLOCKED, draw_scan, flood, straight_is_free
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Points, Pose
from albot_core.ranges import POSITIVE, check_fields


@dataclass(frozen=True, kw_only=True)
class SketchConfig:
    """How fine the sketch is, and how wide a way must be."""

    cell: float = 0.1
    """Side of a cell (m)."""
    reach: float = 7.0
    """What lies farther away is not drawn (m)."""
    near: float = 2.0
    """Ground in view and no farther away than this is covered (m)."""
    extent: float = 40.0
    """Half the side of the first sheet (m); it grows with the way."""
    radius: float = 0.28
    """Ways keep the robot's middle so far from obstacles (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *vars(self))


@dataclass(frozen=True, kw_only=True, eq=False)
class Ways:
    """The ways from where the robot is to all ground that it knows to be free."""

    steps: Int[np.ndarray, "side side"]
    """How many cells away each cell is; -1 where no way is known."""
    before: Int[np.ndarray, "side side"]
    """The cell before each on the way from here, as a flat index."""


class Sketch:
    """A grid of the map's frame, redrawn where the robot looks again.

    It is only as true as the believed pose. What is drawn later counts, so that old
    ground that a drifting belief has moved is replaced.

    Args:
        config: How fine it is.
    """

    def __init__(self, config: SketchConfig = SketchConfig()) -> None:
        self._config = config
        half = int(np.ceil(config.extent / config.cell))
        self._grid = np.zeros((2 * half, 2 * half), np.int8)
        self._covered = np.zeros((2 * half, 2 * half), np.bool_)
        self._radius = config.radius / config.cell

    def draw(self, senses: Senses) -> None:
        """Draw what is in view."""
        config = self._config
        self.make_room(senses.pose[:2])
        draw_scan(
            self._grid,
            self._covered,
            config.cell,
            compose(senses.pose, np.array(senses.laser.mount)),
            senses.ranges,
            senses.laser.bearings,
            (config.near, config.reach),
        )

    def covered(self, points: Points) -> Bool[np.ndarray, "*points"]:
        """Whether the ground at points (m, map frame) is covered, or nothing to stand on."""
        size = len(self._grid)
        cells = np.floor(points / self._config.cell).astype(np.int64) + size // 2
        column, row = np.clip(np.moveaxis(cells, -1, 0), 0, size - 1)
        inside = ((cells >= 0) & (cells < size)).all(axis=-1)
        done = self._covered[row, column] | (self._grid[row, column] == BLOCKED)
        return np.asarray(inside & done)

    def obstacles(self, pose: Pose, reach: float) -> Float64[np.ndarray, "cells 2"]:
        """The middles of blocked cells about a pose, as far as `reach` (m), in the map's frame."""
        row, column = self._cell(pose[:2])
        around = int(reach / self._config.cell)
        low_row, low_column = max(0, row - around), max(0, column - around)
        window = self._grid[low_row : row + around + 1, low_column : column + around + 1]
        rows, columns = np.nonzero(window == BLOCKED)
        cells = np.stack((columns + low_column, rows + low_row), axis=1)
        return (cells + 0.5 - len(self._grid) // 2) * self._config.cell

    def ways(self, pose: Pose, *, hopeful: bool = False, goal: Points | None = None) -> Ways:
        """The ways from a pose; with a goal, no farther than to it.

        Who is hopeful takes the ground that he has not seen yet for free.
        """
        before = np.empty(self._grid.shape, np.int64)
        end = (-1, -1) if goal is None else self._cell(goal)
        steps = flood(self._grid, self._cell(pose[:2]), self._radius, before, hopeful, end)
        return Ways(steps=steps, before=before)

    def length(self, ways: Ways, point: Points) -> float:
        """Length (m) of the way to a point of the map, or near it; infinite if there is none."""
        nearest = self._nearest(ways, point)
        return np.inf if nearest is None else float(ways.steps[nearest] * self._config.cell)

    def route(self, ways: Ways, point: Points) -> Float64[np.ndarray, "cells 2"]:
        """The way to a point, or near it, cell by cell (m, map frame); empty if there is none."""
        cell = self._nearest(ways, point)
        if cell is None:
            return np.empty((0, 2))
        size = len(self._grid)
        cells = [cell]
        while ways.steps[cell] > 0:
            cell = divmod(int(ways.before[cell]), size)
            cells.append(cell)
        rows_columns = np.array(cells[::-1], np.float64)
        return np.asarray((rows_columns[:, ::-1] + 0.5 - size // 2) * self._config.cell)

    def is_straight(self, pose: Pose, point: Points, *, hopeful: bool = False) -> bool:
        """Whether the robot can go from a pose straight to a point (map frame)."""
        start, end = self._cell(pose[:2]), self._cell(point)
        return bool(straight_is_free(self._grid, start, end, self._radius, hopeful))

    def _cell(self, point: Points) -> tuple[int, int]:
        column, row = np.floor(point / self._config.cell).astype(int) + len(self._grid) // 2
        return int(row), int(column)

    def _nearest(self, ways: Ways, point: Points) -> tuple[int, int] | None:
        """The cell within half a metre of a point that is the fewest steps away."""
        row, column = self._cell(point)
        around = int(0.5 / self._config.cell)
        low_row, low_column = max(0, row - around), max(0, column - around)
        window = ways.steps[low_row : row + around + 1, low_column : column + around + 1]
        reached = np.where(window >= 0, window, np.iinfo(np.int32).max)
        if not reached.size or reached.min() == np.iinfo(np.int32).max:
            return None
        i, j = divmod(int(reached.argmin()), window.shape[1])
        return low_row + i, low_column + j

    def make_room(self, point: Points) -> None:
        """Take a larger sheet where a point comes near the edge of this one (m, map frame)."""
        needed = np.abs(point).max() + self._config.reach + 1.0
        while needed > len(self._grid) / 2 * self._config.cell:
            border = len(self._grid) // 2
            self._grid, self._covered = np.pad(self._grid, border), np.pad(self._covered, border)
