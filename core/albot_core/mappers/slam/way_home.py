"""The way home of a metric map: the shortest one over cells that are believed to be free."""

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
from albot_core.ranges import POSITIVE, check_fields


@dataclass(frozen=True, kw_only=True)
class WayHomeConfig:
    """How ways over a grid are found, with the lengths of `OccupancyGridConfig` in planning."""

    coarser: int = 2
    """So many by so many cells of the map are one of the search; blocked where any of them is. A
    power of two."""
    radius: float = 0.28
    """Ways keep the robot's middle so far from what is occupied (m)…"""
    wide: float = 0.45
    """…and are twice as long to it where they come nearer than this (m)."""
    stood: float = 0.25
    """Ground is free so far around where the robot was (m): a laser that looks ahead never sees the
    place where it set out."""
    ahead: float = 2.0
    """How far ahead the point lies that is shown on the way (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "radius", "wide", "stood", "ahead")
        if self.coarser not in (1, 2, 4, 8):
            raise InputError("WayHomeConfig.coarser", "1, 2, 4 or 8", str(self.coarser))


class RouteKeeper:
    """The route home of a map, found anew when the map has changed, and the robot's way along it.

    What it gives follows from the map and the robot's pose alone: nothing of it is to be stored.

    Args:
        config: All parameters.
    """

    def __init__(self, config: WayHomeConfig) -> None:
        self._config = config
        self.forget()

    def forget(self) -> None:
        """Find the route anew when it is asked for next."""
        self._known: tuple[object, Points | None] | None = None

    def way_home(self, version: object, pose: Pose, ground: Callable[[], Ground]) -> WayHome:
        """The way home from where the robot is, along the route.

        Args:
            version: Another one than before where the map has changed since.
            pose: Where the robot is.
            ground: Gives the map, which is asked for only where the route is to be found anew.
        """
        if self._known is None or self._known[0] != version:
            self._known = version, find_route(ground(), self._config)
        return way_along(self._known[1], pose, self._config.ahead)


class Ground(NamedTuple):
    """Where a route is looked for."""

    belief: Float32[np.ndarray, "rows columns"]
    """Of each cell: above 0 where it is occupied, below 0 where it is free, 0 where unknown."""
    corner: Float64[np.ndarray, "2"]
    """x, y of the outer corner of the first cell (m), a whole number of the search's cells…"""
    cell: float
    """…each of which has some of this side (m)."""
    stood: Points
    """Where the robot has been (m), (n, 2), home first. The route begins at the last."""


def find_route(ground: Ground, config: WayHomeConfig) -> Points | None:
    """The shortest way from where the robot stood last to where it stood first.

    It leads over free cells; where home itself is too near to an obstacle, to near by.

    Returns:
        Points along the way, (n, 2), home's cell last; None where there is none.
    """
    stood, cell = ground.stood, ground.cell * config.coarser
    if len(stood) < 2:
        return stood.copy() if len(stood) else np.zeros((1, 2))
    states, corner = _search_cells(ground, config)
    start, goal = (_cell_of(point, corner, cell) for point in (stood[-1], stood[0]))
    parents = np.empty(states.shape, np.int64)
    radii = config.radius / cell, config.wide / cell
    lengths, end = search_grid(states, start, radii, parents, False, goal)
    if end == (-1, -1):
        end = nearest_reached(lengths, *goal, int(NEAR_BY / cell))
    if end == (-1, -1):
        return None
    route = trace_path(lengths, parents, end)
    points: Points = corner + (route[:, ::-1] + 0.5) * cell
    return points


def way_along(route: Points | None, pose: Pose, ahead: float) -> WayHome:
    """The way home from where the robot is: to the nearest point of a route, and on along it.

    Its travel is infinite where there is no route.

    Args:
        route: Points along the way, home last.
        pose: Where the robot is.
        ahead: How far along the route the point lies that is shown (m).
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
    """The cells of the search, and x and y of the outer corner of the first (m).

    They cover all that is known, and where the robot stood.
    """
    cell = ground.cell * config.coarser
    known = coarse_states(ground.belief, config.coarser)
    around = np.arange(-config.stood, config.stood + cell / 2, cell)
    square = np.stack(np.meshgrid(around, around), axis=-1).reshape(-1, 2)
    disc = square[np.hypot(*square.T) <= config.stood]
    stood = (ground.stood[:, None] + disc).reshape(-1, 2)
    at = np.floor((stood - ground.corner) / cell).astype(np.int64)[:, ::-1]
    before = np.maximum(-at.min(axis=0), 0)
    after = np.maximum(at.max(axis=0) + 1 - known.shape, 0)
    states = np.pad(known, np.stack((before, after), axis=1), constant_values=UNKNOWN)
    states[*(at + before).T] = FREE
    return states, ground.corner - before[::-1] * cell


@kernel(arrays=True)
def coarse_states(belief: np.ndarray, coarser: int) -> np.ndarray:
    """What squares of cells are to a search: blocked where any is occupied, free where any is."""
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
