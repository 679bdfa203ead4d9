"""The occupancy grid: free ground, obstacles, and the ground that the robot has covered."""

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
from albot_core.robot import PIONEER_3DX

NEAR_BY = 0.5
"""Largest distance (m) between a point and the end of a path that counts as leading to it."""
NARROW = 1.0
"""Length (m) below which a straight stretch of a route may pass close to obstacles."""
MAX_STRAIGHT = 3.0
"""Longest stretch (m) that is driven straight (Yeap et al.: 3 m)."""
BEHIND = 1.0
"""Distance (m) within which obstacles out of view count."""


@dataclass(frozen=True, kw_only=True)
class OccupancyGridConfig:
    """Parameters of the grid and of paths over it."""

    cell: float = 0.1
    """Side of a cell (m)."""
    reach: float = 7.0
    """Largest distance of cells that a scan marks (m)."""
    coverage_range: float = 2.0
    """Largest distance at which visible ground counts as covered (m)."""
    extent: float = 40.0
    """Half the initial side of the grid (m); the grid grows as needed."""
    robot_radius: float = PIONEER_3DX.radius
    """Radius of the robot's body (m)."""
    clearance: float = 0.03
    """Least distance of the body from obstacles on a path (m)."""
    comfort_clearance: float = 0.2
    """Distance of the body from obstacles (m) within which a path counts twice, because the robot
    must be slow there."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, *vars(self))
        if self.comfort_clearance < self.clearance:
            expected = f"at least the clearance, {self.clearance:g}"
            raise InputError(
                "OccupancyGridConfig.comfort_clearance", expected, f"{self.comfort_clearance:g}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class ShortestPaths:
    """The shortest paths from the robot, over a window of the grid."""

    lengths: Int[np.ndarray, "rows columns"]
    """Length of the path to each cell, in units of `1 / STEP` cell; -1 without a path."""
    parents: Int[np.ndarray, "rows columns"]
    """Flat index of the previous cell on the path to each cell."""
    corner: tuple[int, int]
    """Row and column of the window's first cell, relative to the map's origin."""


class OccupancyGrid:
    """A grid of cells in the map's frame: unknown, free or blocked, and covered or not.

    It is only as accurate as the estimated poses. Later scans overwrite earlier ones, so that cells
    displaced by drift are replaced.

    Args:
        config: The parameters.
    """

    _ABOUT = 0.4
    """Default for half the side of the square of ground around a point (m)."""
    _UNKNOWN_MARGIN = 5.0
    """Distance (m) that paths may lead beyond the seen ground if unknown ground counts as free."""

    def __init__(self, config: OccupancyGridConfig = OccupancyGridConfig()) -> None:
        self._config = config
        half = int(np.ceil(config.extent / config.cell))
        self._grid = np.zeros((2 * half, 2 * half), np.int8)
        self._covered = np.zeros((2 * half, 2 * half), np.bool_)
        self._comfort_radius = config.robot_radius + config.comfort_clearance
        radii = config.robot_radius + config.clearance, self._comfort_radius
        self._radii = radii[0] / config.cell, radii[1] / config.cell
        self._seen = np.zeros((2, 2))

    @property
    def cell(self) -> float:
        """Side of a cell (m)."""
        return self._config.cell

    def integrate(self, percept: Percept) -> None:
        """Mark the scan of a percept."""
        config = self._config
        self.grow_to(percept.pose[:2])
        sensor_pose = compose(percept.pose, np.array(percept.laser.mount))
        beams = config.cell, sensor_pose, percept.ranges, percept.laser.bearings
        mark_scan(self._grid, *beams, config.reach)
        mark_covered(self._covered, *beams, config.coverage_range)
        np.minimum(self._seen[0], sensor_pose[:2] - config.reach, out=self._seen[0])
        np.maximum(self._seen[1], sensor_pose[:2] + config.reach, out=self._seen[1])

    def grow_to(self, point: Points) -> None:
        """Enlarge the grid if a point (m, map frame) is near its edge."""
        needed = np.abs(point).max() + self._config.reach + 1.0
        while needed > len(self._grid) / 2 * self._config.cell:
            border = len(self._grid) // 2
            self._grid, self._covered = np.pad(self._grid, border), np.pad(self._covered, border)

    def uncovered_share(
        self, points: Points, about: float = _ABOUT
    ) -> Float64[np.ndarray, "points"]:
        """Return the uncovered share of the ground around each point.

        It is 0 for points that are themselves covered or blocked.

        Args:
            points: The points (m, map frame).
            about: Half the side of the square of ground around a point (m).
        """
        cells = np.floor(points[:, ::-1] / self._config.cell).astype(np.int64)
        around = int(about / self._config.cell)
        return uncovered_shares(self._grid, self._covered, cells + len(self._grid) // 2, around)

    def shortest_paths(
        self, pose: Pose, *, unknown_is_free: bool = False, goal: Points | None = None
    ) -> ShortestPaths:
        """Return the shortest paths from a pose to all ground, or only to a goal.

        With a goal, paths to points off the path to the goal may be too long or missing.

        Args:
            pose: The pose (map frame).
            unknown_is_free: Whether unseen ground counts as free.
            goal: The goal (m, map frame); None for all ground.
        """
        margin = self._UNKNOWN_MARGIN if unknown_is_free else self._comfort_radius
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
        """Return the length (m) of the path to a point (map frame) or near it, or infinity."""
        cell = self._nearest(paths, point)
        return np.inf if cell is None else float(paths.lengths[cell] / STEP * self._config.cell)

    def route(self, paths: ShortestPaths, point: Points) -> Float64[np.ndarray, "cells 2"]:
        """Return the path to a point or near it, cell by cell (m, map frame); empty for none."""
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
        """Return the farthest point of a route within `MAX_STRAIGHT` that can be reached straight.

        If there is none, return a point a little farther along the route than its nearest point.
        Without a route, return the robot's position. The point is in the map's frame (m).
        """
        if not len(route):
            return pose[:2]
        cells = np.floor(route[:, ::-1] / self._config.cell).astype(np.int64)
        column, row = (pose[:2] / self._config.cell + len(self._grid) // 2).tolist()
        chosen = farthest_straight(
            self._grid,
            (row, column),
            cells + len(self._grid) // 2,
            (NARROW / self._config.cell, MAX_STRAIGHT / self._config.cell),
            self._radii,
            unknown_is_free,
        )
        return np.array(route[chosen])

    def obstacles_around(self, percept: Percept) -> Float64[np.ndarray, "points 2"]:
        """Return visible points, and nearby mapped obstacles out of view (m, robot's frame)."""
        known = percept.to_robot(self.obstacles(percept.pose, BEHIND))
        bearings = bearings_of(known)
        first, last = percept.laser.bearings[[0, -1]] + percept.laser.mount[2]
        behind = (bearings < first) | (bearings > last)
        return np.concatenate((percept.points, known[behind]))

    def obstacles(self, pose: Pose, reach: float) -> Float64[np.ndarray, "cells 2"]:
        """Return the centres (m, map frame) of blocked cells within `reach` (m) of a pose."""
        row, column = self._cell(pose[:2])
        cells = blocked_around(self._grid, row, column, int(reach / self._config.cell))
        return self.centres(cells - len(self._grid) // 2)

    def window(
        self, paths: ShortestPaths
    ) -> tuple[Int8[np.ndarray, "rows columns"], Bool[np.ndarray, "rows columns"]]:
        """Return the cells of the paths' window, and which of them are covered."""
        row, column = np.array(paths.corner) + len(self._grid) // 2
        rows, columns = paths.lengths.shape
        window = slice(row, row + rows), slice(column, column + columns)
        return self._grid[window], self._covered[window]

    def centres(self, cells: Int64[np.ndarray, "n 2"]) -> Float64[np.ndarray, "n 2"]:
        """Return the centres (m, map frame) of cells, given by row and column from the origin."""
        return np.asarray((cells[:, ::-1] + 0.5) * self._config.cell)

    def _cell(self, point: Points) -> tuple[int, int]:
        half, cell = len(self._grid) // 2, self._config.cell
        x, y = point.tolist()
        return int(y // cell) + half, int(x // cell) + half

    def _window(
        self, place: Points, goal: Points | None, margin: float
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return first and last rows and columns of the seen ground, the points and a margin."""
        points = np.stack((*self._seen, place, place if goal is None else goal))
        margin += 2 * self._config.cell
        low, high = self._cell(points.min(axis=0) - margin), self._cell(points.max(axis=0) + margin)
        size = len(self._grid)
        return (
            (max(0, low[0]), max(0, low[1])),
            (min(size, high[0] + 1), min(size, high[1] + 1)),
        )

    def _nearest(self, paths: ShortestPaths, point: Points) -> tuple[int, int] | None:
        """Return the cell of the paths' window near a point with the shortest path, or None."""
        row, column = self._cell(point)
        half = len(self._grid) // 2
        around = int(NEAR_BY / self._config.cell)
        row, column = row - half - paths.corner[0], column - half - paths.corner[1]
        found = nearest_reached(paths.lengths, row, column, around)
        return None if found[0] < 0 else found
