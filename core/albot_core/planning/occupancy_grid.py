"""The occupancy grid: where the robot saw free ground and obstacles, and what it has covered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int, Int8, Int64

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import bearings_of
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Points, Pose
from albot_core.planning.grid_search import STEP, nearest_reached, search_grid, trace_path
from albot_core.planning.occupancy_grid_kernels import (
    blocked_around,
    farthest_straight,
    mark_covered,
    mark_scan,
    uncovered_shares,
)
from albot_core.planning.percept import Percept
from albot_core.ranges import POSITIVE, check_fields

NEAR_BY = 0.5
"""A path that ends no farther from a point than this (m) leads to it."""
NARROW = 1.0
"""Stretches of a route shorter than this (m) may lead close past things."""
SIGHT = 3.0
"""The farthest stretch (m) that is driven straight at once (Yeap et al.: 3 m)."""
BEHIND = 1.0
"""How far away (m) obstacles that are out of view count."""


@dataclass(frozen=True, kw_only=True)
class OccupancyGridConfig:
    """How fine the grid is, and how wide a path must be."""

    cell: float = 0.1
    """Side of a cell (m)."""
    reach: float = 7.0
    """What lies farther away is not marked (m)."""
    near: float = 2.0
    """Ground in view and no farther away than this is covered (m)."""
    extent: float = 40.0
    """Half the side of the grid at first (m); it grows with the way."""
    radius: float = 0.28
    """Paths keep the robot's middle so far from obstacles (m)…"""
    wide: float = 0.45
    """…and are twice as long to it where they come nearer than this (m): there it must be slow."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *vars(self))
        if self.wide < self.radius:
            expected = f"at least the radius, {self.radius:g}"
            raise InputError("OccupancyGridConfig.wide", expected, f"{self.wide:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class ShortestPaths:
    """The shortest paths from where the robot is, over a window of the grid."""

    lengths: Int[np.ndarray, "rows columns"]
    """The length of the path to each cell, in shares `1 / STEP` of a cell; -1 where none is
    known."""
    parents: Int[np.ndarray, "rows columns"]
    """The cell before each on its path, as a flat index."""
    corner: tuple[int, int]
    """Row and column of the window's first cell, counted from the map's origin."""


class OccupancyGrid:
    """A grid of cells in the map's frame: unknown, free or blocked, and covered or not.

    It is only as true as the believed pose. A later scan overwrites earlier ones, so that old
    ground that a drifting belief has moved is replaced.

    Args:
        config: How fine it is.
    """

    _ABOUT = 0.4
    """Half the side of the square (m) about a point that is the ground there, unless said."""
    _UNKNOWN_MARGIN = 5.0
    """Where unknown ground counts as free, paths lead so far (m) beyond what was seen."""

    def __init__(self, config: OccupancyGridConfig = OccupancyGridConfig()) -> None:
        self._config = config
        half = int(np.ceil(config.extent / config.cell))
        self._grid = np.zeros((2 * half, 2 * half), np.int8)
        self._covered = np.zeros((2 * half, 2 * half), np.bool_)
        self._radii = config.radius / config.cell, config.wide / config.cell
        self._seen = np.zeros((2, 2))

    @property
    def cell(self) -> float:
        """Side of a cell (m)."""
        return self._config.cell

    def integrate(self, percept: Percept) -> None:
        """Mark what is in view."""
        config = self._config
        self.grow_to(percept.pose[:2])
        eye = compose(percept.pose, np.array(percept.laser.mount))
        beams = config.cell, eye, percept.ranges, percept.laser.bearings
        mark_scan(self._grid, *beams, config.reach)
        mark_covered(self._covered, *beams, config.near)
        np.minimum(self._seen[0], eye[:2] - config.reach, out=self._seen[0])
        np.maximum(self._seen[1], eye[:2] + config.reach, out=self._seen[1])

    def grow_to(self, point: Points) -> None:
        """Enlarge the grid where a point comes near its edge (m, map frame)."""
        needed = np.abs(point).max() + self._config.reach + 1.0
        while needed > len(self._grid) / 2 * self._config.cell:
            border = len(self._grid) // 2
            self._grid, self._covered = np.pad(self._grid, border), np.pad(self._covered, border)

    def uncovered_share(
        self, points: Points, about: float = _ABOUT
    ) -> Float64[np.ndarray, "points"]:
        """The share of the ground about points (m, map frame) that is left to be covered.

        It is 0 where the points themselves are covered or blocked.

        Args:
            points: The points.
            about: Half the side of the square (m) about each that is the ground there.
        """
        cells = np.floor(points[:, ::-1] / self._config.cell).astype(np.int64)
        around = int(about / self._config.cell)
        return uncovered_shares(self._grid, self._covered, cells + len(self._grid) // 2, around)

    def shortest_paths(
        self, pose: Pose, *, unknown_is_free: bool = False, goal: Points | None = None
    ) -> ShortestPaths:
        """The shortest paths from a pose; with a goal, no farther than to it.

        With a goal, paths to points that are not on the path there may be too long, or missing.

        Args:
            pose: The pose (map frame).
            unknown_is_free: Whether ground that was not seen yet counts as free.
            goal: The goal (m, map frame); None for all ground.
        """
        margin = self._UNKNOWN_MARGIN if unknown_is_free else self._config.wide
        low, high = self._window(pose[:2], goal, margin)
        window = np.ascontiguousarray(self._grid[low[0] : high[0], low[1] : high[1]])
        parents = np.empty(window.shape, np.int64)
        row, column = self._cell(pose[:2])
        start, end = (row - low[0], column - low[1]), (-1, -1)
        if goal is not None:
            goal_row, goal_column = self._cell(goal)
            end = (goal_row - low[0], goal_column - low[1])
        lengths, _ = search_grid(window, start, self._radii, parents, unknown_is_free, end)
        half = len(self._grid) // 2
        corner = low[0] - half, low[1] - half
        return ShortestPaths(lengths=lengths, parents=parents, corner=corner)

    def length(self, paths: ShortestPaths, point: Points) -> float:
        """Length (m) of the path to a point of the map, or near it; infinite if there is none."""
        cell = self._nearest(paths, point)
        return np.inf if cell is None else float(paths.lengths[cell] / STEP * self._config.cell)

    def route(self, paths: ShortestPaths, point: Points) -> Float64[np.ndarray, "cells 2"]:
        """The path to a point, or near it, cell by cell (m, map frame); empty if there is none."""
        cell = self._nearest(paths, point)
        if cell is None:
            return np.empty((0, 2))
        return self.centres(trace_path(paths.lengths, paths.parents, cell) + paths.corner)

    def lookahead_point(
        self,
        pose: Pose,
        route: Float64[np.ndarray, "cells 2"],
        *,
        unknown_is_free: bool = False,
    ) -> Points:
        """The farthest point of a route within `SIGHT` that can be gone to straight (map frame).

        Where none can, it is one a little farther along the route than where it is nearest. Where
        there is no route it is where the robot is.
        """
        if not len(route):
            return pose[:2]
        cells = np.floor(route[:, ::-1] / self._config.cell).astype(np.int64)
        column, row = (pose[:2] / self._config.cell + len(self._grid) // 2).tolist()
        chosen = farthest_straight(
            self._grid,
            (row, column),
            cells + len(self._grid) // 2,
            (NARROW / self._config.cell, SIGHT / self._config.cell),
            self._radii,
            unknown_is_free,
        )
        return np.array(route[chosen])

    def obstacles_around(self, percept: Percept) -> Float64[np.ndarray, "points 2"]:
        """What is in view, and what was seen near by but lies behind now (m, robot's frame)."""
        known = percept.to_robot(self.obstacles(percept.pose, BEHIND))
        bearings = bearings_of(known)
        first, last = percept.laser.bearings[[0, -1]] + percept.laser.mount[2]
        behind = (bearings < first) | (bearings > last)
        return np.concatenate((percept.points, known[behind]))

    def obstacles(self, pose: Pose, reach: float) -> Float64[np.ndarray, "cells 2"]:
        """The centres of blocked cells about a pose, as far as `reach` (m), in the map's frame."""
        row, column = self._cell(pose[:2])
        cells = blocked_around(self._grid, row, column, int(reach / self._config.cell))
        return self.centres(cells - len(self._grid) // 2)

    def window(
        self, paths: ShortestPaths
    ) -> tuple[Int8[np.ndarray, "rows columns"], Bool[np.ndarray, "rows columns"]]:
        """The window of the grid that paths are over: its cells, and which of them are covered."""
        row, column = np.array(paths.corner) + len(self._grid) // 2
        rows, columns = paths.lengths.shape
        window = slice(row, row + rows), slice(column, column + columns)
        return self._grid[window], self._covered[window]

    def centres(self, cells: Int64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 2"]:
        """The centres (m, map frame) of cells by row and column, counted from the map's origin."""
        return np.asarray((cells[:, ::-1] + 0.5) * self._config.cell)

    def _cell(self, point: Points) -> tuple[int, int]:
        half, cell = len(self._grid) // 2, self._config.cell
        x, y = point.tolist()
        return int(y // cell) + half, int(x // cell) + half

    def _window(
        self, place: Points, goal: Points | None, margin: float
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        """First and last rows and columns of what was seen, with these points and a margin."""
        points = np.stack((*self._seen, place, place if goal is None else goal))
        margin += 2 * self._config.cell
        low, high = self._cell(points.min(axis=0) - margin), self._cell(points.max(axis=0) + margin)
        size = len(self._grid)
        return (
            (max(0, low[0]), max(0, low[1])),
            (min(size, high[0] + 1), min(size, high[1] + 1)),
        )

    def _nearest(self, paths: ShortestPaths, point: Points) -> tuple[int, int] | None:
        """The cell near a point with the shortest path, in the paths' window."""
        row, column = self._cell(point)
        half = len(self._grid) // 2
        around = int(NEAR_BY / self._config.cell)
        row, column = row - half - paths.corner[0], column - half - paths.corner[1]
        found = nearest_reached(paths.lengths, row, column, around)
        return None if found[0] < 0 else found
