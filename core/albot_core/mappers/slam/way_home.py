"""The way home in a metric map: the shortest path over free cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Int8

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import POINT, TRAVEL, WayHome
from albot_core.planning.grid_search import (
    BLOCKED,
    FREE,
    UNKNOWN,
    nearest_reached,
    search_grid,
    trace_path,
)
from albot_core.planning.occupancy_grid import NEAR_BY
from albot_core.ranges import POSITIVE, Range, check_fields
from albot_core.robot import PIONEER_3DX

_COARSER = Range("1, 2, 4 or 8", 1.0, 8.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class WayHomeConfig:
    """Parameters of the search for paths over a grid; cf. `OccupancyGridConfig` in planning."""

    coarser: int = 2
    """Number of map cells along each side of a search cell, a power of two. A search cell is
    blocked if any of its map cells is occupied."""
    robot_radius: float = PIONEER_3DX.radius
    """Radius of the robot's body (m); an environment puts that of its robot here. The ground on
    which it has stood counts as free: a laser that looks ahead never sees the starting place."""
    clearance: float = 0.03
    """Smallest distance of the body from occupied cells on a path (m)."""
    comfort_clearance: float = 0.2
    """Distance of the body from occupied cells below which path length counts twice (m)."""
    ahead: float = 2.0
    """Distance along the path of the point that is reported (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "robot_radius", "clearance", "comfort_clearance", "ahead")
        check_fields(self, _COARSER, "coarser")
        if self.coarser & (self.coarser - 1):
            raise InputError("WayHomeConfig.coarser", _COARSER.expected, str(self.coarser))


class RouteKeeper:
    """The route home of a map, searched again when the map has changed.

    The result follows from the map and the robot's pose alone, so no state must be saved.

    Args:
        config: All parameters.
    """

    def __init__(self, config: WayHomeConfig) -> None:
        self._config = config
        self.forget()

    def forget(self) -> None:
        """Search the route again at the next call of `way_home`."""
        self._known: tuple[object, Points | None] | None = None

    def way_home(self, version: object, pose: Pose, ground: Callable[[], Ground]) -> WayHome:
        """Return the way home from the robot's pose, along the route.

        Args:
            version: Changes whenever the map has changed.
            pose: The robot's pose.
            ground: Returns the map; only called if the route must be searched again.
        """
        if self._known is None or self._known[0] != version:
            self._known = version, find_route(ground(), self._config)
        return way_along(self._known[1], pose, self._config.ahead)


class Ground(NamedTuple):
    """The map in which a route is searched."""

    belief: Float32[np.ndarray, "rows columns"]
    """State of each cell: above 0 if occupied, below 0 if free, 0 if unknown."""
    corner: Float64[np.ndarray, "2"]
    """x, y of the outer corner of the first cell (m); a multiple of the search cell's side."""
    cell: float
    """Side of a cell (m)."""
    stood: Points
    """The robot's positions so far (m), (n, 2), home first. The route starts at the last one."""


def find_route(ground: Ground, config: WayHomeConfig) -> Points | None:
    """Find the shortest path from the robot's last position to its first one.

    The path leads over free cells. If home is too near to an obstacle, it ends close to home.

    Returns:
        Points along the path, (n, 2), home's cell last; None if there is no path.
    """
    stood, cell = ground.stood, ground.cell * config.coarser
    if len(stood) < 2:
        return stood.copy() if len(stood) else np.zeros((1, 2))
    states, corner = _search_cells(ground, config)
    start, goal = (_cell_of(point, corner, cell) for point in (stood[-1], stood[0]))
    parents = np.empty(states.shape, np.int64)
    radius, wide = (config.robot_radius + c for c in (config.clearance, config.comfort_clearance))
    radii = radius / cell, wide / cell
    lengths, end = search_grid(states, start, radii, parents, False, goal)
    if end == (-1, -1):
        end = nearest_reached(lengths, *goal, int(NEAR_BY / cell))
    if end == (-1, -1):
        return None
    route = trace_path(lengths, parents, end)
    points: Points = corner + (route[:, ::-1] + 0.5) * cell
    return points


def way_along(route: Points | None, pose: Pose, ahead: float) -> WayHome:
    """Return the way home from a pose: to the nearest point of a route, then along the route.

    Its travel is infinite if there is no route.

    Args:
        route: Points along the path, home last.
        pose: The robot's pose.
        ahead: Distance along the route of the point that is reported (m).
    """
    way = np.full(7, np.nan)
    if route is None:
        way[TRAVEL] = np.inf
        return way
    aside = np.hypot(*(route - pose[:2]).T)
    nearest = int(np.argmin(aside))
    steps = np.hypot(*np.diff(route[nearest:], axis=0).T)
    gone = np.concatenate(((0.0,), np.cumsum(steps)))
    way[TRAVEL] = aside[nearest] + gone[-1]
    if gone[-1] >= ahead:
        way[POINT] = route[nearest + int(np.searchsorted(gone, ahead))]
    return way


def _search_cells(
    ground: Ground, config: WayHomeConfig
) -> tuple[Int8[np.ndarray, "rows columns"], Float64[np.ndarray, "2"]]:
    """Return the search cells, and x, y of the outer corner of the first one (m).

    They cover all known cells and the robot's earlier positions.
    """
    cell = ground.cell * config.coarser
    known = coarse_states(ground.belief, config.coarser)
    radius = config.robot_radius
    around = np.arange(-radius, radius + cell / 2, cell)
    square = np.stack(np.meshgrid(around, around), axis=-1).reshape(-1, 2)
    disc = square[np.hypot(*square.T) <= radius]
    stood = (ground.stood[:, None] + disc).reshape(-1, 2)
    at = np.floor((stood - ground.corner) / cell).astype(np.int64)[:, ::-1]
    before = np.maximum(-at.min(axis=0), 0)
    after = np.maximum(at.max(axis=0) + 1 - known.shape, 0)
    states = np.pad(known, np.stack((before, after), axis=1), constant_values=UNKNOWN)
    states[*(at + before).T] = FREE
    return states, ground.corner - before[::-1] * cell


@kernel(arrays=True)
def coarse_states(belief: np.ndarray, coarser: int) -> np.ndarray:
    """Return the search cells: blocked if any map cell is occupied, else free if any is free."""
    rows, columns = belief.shape
    states = np.full((-(-rows // coarser), -(-columns // coarser)), UNKNOWN, np.int8)
    for i in range(rows):
        for j in range(columns):
            row, column = i // coarser, j // coarser
            if belief[i, j] > 0.0:
                states[row, column] = BLOCKED
            elif belief[i, j] < 0.0 and states[row, column] == UNKNOWN:
                states[row, column] = FREE
    return states


def _cell_of(
    point: Float64[np.ndarray, "2"], corner: Float64[np.ndarray, "2"], cell: float
) -> tuple[int, int]:
    column, row = np.floor((point - corner) / cell).astype(int).tolist()
    return row, column
