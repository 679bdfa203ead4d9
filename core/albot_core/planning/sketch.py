"""The sketch: where the robot has seen free ground and obstacles, and what it has covered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int, Int8, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Points, Pose
from albot_core.planning.senses import Senses
from albot_core.planning.sketch_kernels import (
    STEP,
    blocked_around,
    cover_scan,
    draw_scan,
    farthest_straight,
    flood,
    nearest_reached,
    straight_is_free,
    trace,
    uncovered_shares,
)
from albot_core.ranges import POSITIVE, check_fields

NEAR_BY = 0.5
"""A way that ends no farther from a point than this (m) leads to it."""
NARROW = 1.0
"""Stretches of a route shorter than this (m) may lead close past things."""


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
    """Ways keep the robot's middle so far from obstacles (m)…"""
    wide: float = 0.45
    """…and are twice as long to it where they come nearer than this (m): there it must be slow."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *vars(self))
        if self.wide < self.radius:
            expected = f"at least the radius, {self.radius:g}"
            raise InputError("SketchConfig.wide", expected, f"{self.wide:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Ways:
    """The ways from where the robot is to all ground that it knows to be free."""

    lengths: Int[np.ndarray, "rows columns"]
    """How long the way is to each cell of a part of the sheet, in shares `1 / STEP` of a cell; -1
    where no way is known."""
    before: Int[np.ndarray, "rows columns"]
    """The cell before each on the way from here, as a flat index."""
    corner: tuple[int, int]
    """Row and column of the part's first cell, counted from the map's origin."""


class Sketch:
    """A grid of the map's frame, redrawn where the robot looks again.

    It is only as true as the believed pose. What is drawn later counts, so that old
    ground that a drifting belief has moved is replaced.

    Args:
        config: How fine it is.
    """

    _ABOUT = 0.4
    """Half the side of the square (m) about a point that is the ground there, unless said."""
    _HOPE = 5.0
    """How far (m) beyond what it has seen who is hopeful looks for ways."""

    def __init__(self, config: SketchConfig = SketchConfig()) -> None:
        self._config = config
        half = int(np.ceil(config.extent / config.cell))
        self._grid = np.zeros((2 * half, 2 * half), np.int8)
        self._covered = np.zeros((2 * half, 2 * half), np.bool_)
        self._radii = config.radius / config.cell, config.wide / config.cell
        self._drawn = np.zeros((2, 2))

    @property
    def cell(self) -> float:
        """Side of a cell (m)."""
        return self._config.cell

    def draw(self, senses: Senses) -> None:
        """Draw what is in view."""
        config = self._config
        self.make_room(senses.pose[:2])
        eye = compose(senses.pose, np.array(senses.laser.mount))
        beams = config.cell, eye, senses.ranges, senses.laser.bearings
        draw_scan(self._grid, *beams, config.reach)
        cover_scan(self._covered, *beams, config.near)
        np.minimum(self._drawn[0], eye[:2] - config.reach, out=self._drawn[0])
        np.maximum(self._drawn[1], eye[:2] + config.reach, out=self._drawn[1])

    def covered(self, points: Points) -> Bool[np.ndarray, "points"]:
        """Whether the ground at points (m, map frame) is covered, or nothing to stand on."""
        return np.asarray(self.uncovered(points) == 0)

    def uncovered(self, points: Points, about: float = _ABOUT) -> Float64[np.ndarray, "points"]:
        """The share of the ground about points (m, map frame) that is left to be covered.

        None is where the points themselves are covered, or nothing to stand on.

        Args:
            points: The points.
            about: Half the side of the square (m) about each that is the ground there.
        """
        cells = np.floor(points[:, ::-1] / self._config.cell).astype(np.int64)
        around = int(about / self._config.cell)
        return uncovered_shares(self._grid, self._covered, cells + len(self._grid) // 2, around)

    def obstacles(self, pose: Pose, reach: float) -> Float64[np.ndarray, "cells 2"]:
        """The middles of blocked cells about a pose, as far as `reach` (m), in the map's frame."""
        row, column = self._cell(pose[:2])
        cells = blocked_around(self._grid, row, column, int(reach / self._config.cell))
        return self.middles(cells - len(self._grid) // 2)

    def ways(self, pose: Pose, *, hopeful: bool = False, goal: Points | None = None) -> Ways:
        """The ways from a pose; with a goal, no farther than to it.

        With a goal, ways to points that are not on the way there may be too long, or missing.
        Who is hopeful takes the ground that he has not seen yet for free.
        """
        low, high = self._part(pose[:2], goal, self._HOPE if hopeful else self._config.wide)
        part = np.ascontiguousarray(self._grid[low[0] : high[0], low[1] : high[1]])
        before = np.empty(part.shape, np.int64)
        row, column = self._cell(pose[:2])
        end = (-1, -1)
        if goal is not None:
            goal_row, goal_column = self._cell(goal)
            end = (goal_row - low[0], goal_column - low[1])
        lengths, _ = flood(part, (row - low[0], column - low[1]), self._radii, before, hopeful, end)
        half = len(self._grid) // 2
        return Ways(lengths=lengths, before=before, corner=(low[0] - half, low[1] - half))

    def length(self, ways: Ways, point: Points) -> float:
        """Length (m) of the way to a point of the map, or near it; infinite if there is none."""
        cell = self._nearest(ways, point)
        return np.inf if cell is None else float(ways.lengths[cell] / STEP * self._config.cell)

    def route(self, ways: Ways, point: Points) -> Float64[np.ndarray, "cells 2"]:
        """The way to a point, or near it, cell by cell (m, map frame); empty if there is none."""
        cell = self._nearest(ways, point)
        if cell is None:
            return np.empty((0, 2))
        return self.middles(trace(ways.lengths, ways.before, cell) + ways.corner)

    def part(
        self, ways: Ways
    ) -> tuple[Int8[np.ndarray, "rows columns"], Bool[np.ndarray, "rows columns"]]:
        """The part of the sheet that ways are of: its cells, and which of them are covered."""
        row, column = np.array(ways.corner) + len(self._grid) // 2
        rows, columns = ways.lengths.shape
        part = slice(row, row + rows), slice(column, column + columns)
        return self._grid[part], self._covered[part]

    def middles(self, cells: Int64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 2"]:
        """The middles (m, map frame) of cells by row and column, counted from the map's origin."""
        return np.asarray((cells[:, ::-1] + 0.5) * self._config.cell)

    def is_straight(self, pose: Pose, point: Points, *, hopeful: bool = False) -> bool:
        """Whether the robot can go from a pose straight to a point (map frame)."""
        start, end = self._cell(pose[:2]), self._cell(point)
        return bool(straight_is_free(self._grid, start, end, self._radii[0], hopeful))

    def along(
        self,
        pose: Pose,
        route: Float64[np.ndarray, "cells 2"],
        sight: float,
        *,
        hopeful: bool = False,
    ) -> Points:
        """The farthest point of a route within sight (m) that can be gone to straight.

        Where none can, it is one a little farther along the route than where it is nearest.
        """
        cells = np.floor(route[:, ::-1] / self._config.cell).astype(np.int64)
        column, row = (pose[:2] / self._config.cell + len(self._grid) // 2).tolist()
        chosen = farthest_straight(
            self._grid,
            (row, column),
            cells + len(self._grid) // 2,
            (NARROW / self._config.cell, sight / self._config.cell),
            self._radii,
            hopeful,
        )
        return np.array(route[chosen])

    def _cell(self, point: Points) -> tuple[int, int]:
        half, cell = len(self._grid) // 2, self._config.cell
        x, y = point.tolist()
        return int(y // cell) + half, int(x // cell) + half

    def _part(
        self, place: Points, goal: Points | None, margin: float
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        """First and last rows and columns of what is drawn, with these points and a margin."""
        points = np.stack((*self._drawn, place, place if goal is None else goal))
        margin += 2 * self._config.cell
        low, high = self._cell(points.min(axis=0) - margin), self._cell(points.max(axis=0) + margin)
        size = len(self._grid)
        return (
            (max(0, low[0]), max(0, low[1])),
            (min(size, high[0] + 1), min(size, high[1] + 1)),
        )

    def _nearest(self, ways: Ways, point: Points) -> tuple[int, int] | None:
        """The cell near a point with the shortest way, in the ways' part of the sheet."""
        row, column = self._cell(point)
        half = len(self._grid) // 2
        around = int(NEAR_BY / self._config.cell)
        row, column = row - half - ways.corner[0], column - half - ways.corner[1]
        found = nearest_reached(ways.lengths, row, column, around)
        return None if found[0] < 0 else found

    def make_room(self, point: Points) -> None:
        """Take a larger sheet where a point comes near the edge of this one (m, map frame)."""
        needed = np.abs(point).max() + self._config.reach + 1.0
        while needed > len(self._grid) / 2 * self._config.cell:
            border = len(self._grid) // 2
            self._grid, self._covered = np.pad(self._grid, border), np.pad(self._covered, border)
