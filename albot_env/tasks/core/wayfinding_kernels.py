"""Compiled loops of wayfinding: the robots' occupancy grids, and the paths home found on them.

At each step `update_occupancy` draws the robot's readings on its grid. Every few steps
`find_shortcut` and `find_path` search the grid for paths home, and `find_onward` (`onward_kernels`)
for one to uncovered ground; their results are kept until the next search.
`albot_core.planning.grid_search` defines the values of cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import compose, length_of, transform_point
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import (
    STEP,
    nearest_reached,
    search_grid,
    trace_path,
)
from albot_core.planning.occupancy_grid_kernels import (
    farthest_straight,
    mark_scan,
)
from albot_env.tasks.core.coverage_kernels import (
    CoverageSensor,
    accumulate_motion,
)

POINT, LENGTH = slice(0, 2), 2
"""Columns of a way in `OccupancyGrids`: a point ahead on it, and its length."""
NOWHERE = (-1, -1)
"""Goal of a search for the ways to all cells."""
_BARRED, _FARTHER, _AT_HAND = 10.0, 0.5, 0.7
"""Number of searches that find a known way barred after which it is left; how far the robot must
come on it (m) until they are counted anew; how much longer a way must be (m): as in `Navigator`."""


class OccupancyParams(NamedTuple):
    """Parameters of the occupancy grids."""

    cell: float
    """Side of a cell (m)."""
    reach: float
    """Maximum distance at which readings are drawn (m)."""
    jump: float
    """A belief farther than this (m) from the odometry's prediction clears the grid."""
    spacing: float
    """The grid is updated each time the robot has moved this far (m)…"""
    turn: float
    """…or turned this much (rad) since the last update."""
    every: int
    """Number of steps between searches for ways."""


class OccupancyGrids(NamedTuple):
    """Occupancy grids (map frames) and the ways found on them, one row per robot."""

    grids: np.ndarray
    """(n, cells) int8: values of the cells, row by row, x along a row."""
    sides: np.ndarray
    """(n,) int64: number of cells along each side; the map's origin is at the centre."""
    ages: np.ndarray
    """(n,) int64: number of steps since each grid was cleared."""
    moved: np.ndarray
    """(n, 2) float64: distance and turning since the last update of the grid (m, rad)."""
    beliefs: np.ndarray
    """(n, 3) float64: believed pose at the last step (map frame)."""
    shortcuts: np.ndarray
    """(n, 3) float64: the point ahead (map frame, m) on the shortest way home through free and
    unseen cells, and the length of that way, doubled close to obstacles (m); NaN and infinite if
    there is none."""
    onwards: np.ndarray
    """(n, 3) float64: the same for the way, through cells seen to be free, that shows most new
    ground for its length."""
    paths: np.ndarray
    """(n, 3) float64: the same for the way home that the robot had better take: the shortcut if it
    is worth leaving the known way, or that is barred; else the shortest way to the next point on
    the known one."""
    drawn: np.ndarray
    """(n, 2, 2) int64: first row and column of the part of each grid that readings were drawn in,
    and those behind its last."""
    barred: np.ndarray
    """(n, 2) float64: least length of the known way home so far (m), and how many searches have
    found it barred since."""


class SearchParams(NamedTuple):
    """Parameters of the search for ways (see `WayfindingConfig`); lengths in m."""

    cell: float
    radii: tuple[float, float]
    """Minimum distance of ways from occupied cells, and distance below which they count twice as
    long (cells)."""
    margin: float
    first: float
    last: float
    narrow: float
    """Stretches shorter than this may lead close past obstacles."""
    ahead: float
    at_goal: float
    """A way that ends within this distance of home leads home."""
    worth: float
    sight: float
    """Ground up to this far around a place, along each axis, is seen from there."""
    stay: float
    """The gain at a place is divided by the length of the way there and this."""


@kernel(arrays=True)
def update_occupancy(
    occupancy: OccupancyGrids,
    i: int,
    params: OccupancyParams,
    sensor: CoverageSensor,
    motion: np.ndarray,
    belief: np.ndarray,
    ranges: np.ndarray,
) -> bool:
    """Draw robot i's readings on its grid; return whether a search for ways is due.

    If the belief has jumped, the grid is cleared first, because its contents are misplaced.
    """
    if occupancy.ages[i] and _has_jumped(occupancy.beliefs[i], motion, belief, params.jump):
        clear_occupancy(occupancy, i)
    for k in range(belief.shape[0]):
        occupancy.beliefs[i, k] = belief[k]
    if accumulate_motion(motion, params.spacing, params.turn, occupancy.moved[i]):
        _draw(occupancy, i, params, sensor, belief, ranges)
    is_time = occupancy.ages[i] % params.every == 0
    occupancy.ages[i] += 1
    return bool(is_time)


@kernel()
def clear_occupancy(occupancy: OccupancyGrids, i: int) -> None:
    """Clear robot i's occupancy grid."""
    side = occupancy.sides[i]
    occupancy.grids[i, : side * side] = 0
    occupancy.ages[i] = 0
    occupancy.moved[i] = math.inf
    occupancy.drawn[i, 0], occupancy.drawn[i, 1] = side, 0
    forget_way(occupancy.shortcuts[i])
    forget_way(occupancy.onwards[i])
    forget_way(occupancy.paths[i])
    occupancy.barred[i, 0], occupancy.barred[i, 1] = math.inf, 0.0


@kernel()
def _has_jumped(before: np.ndarray, motion: np.ndarray, now: np.ndarray, jump: float) -> bool:
    """Whether a belief differs from the odometry's prediction by more than `jump` (m)."""
    x, y, _ = compose(before, motion)
    return length_of(now[0] - x, now[1] - y) > jump


@kernel(arrays=True)
def _draw(
    occupancy: OccupancyGrids,
    i: int,
    params: OccupancyParams,
    sensor: CoverageSensor,
    belief: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Draw a scan on robot i's grid if all of it is on the grid."""
    grid = occupancy_of(occupancy, i)
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    x, y = transform_point(belief, cos, sin, sensor.x, sensor.y)
    eye = np.array((x, y, belief[2] + sensor.first))
    farthest = max(abs(eye[0]), abs(eye[1])) + params.reach + params.cell
    if farthest < (grid.shape[0] // 2) * params.cell:
        bearings = np.arange(ranges.shape[0]) * sensor.spacing
        reach, drawn = int(params.reach / params.cell) + 2, occupancy.drawn[i]
        for axis, place in enumerate(cell_of(grid, eye, params.cell)):
            drawn[0, axis] = min(drawn[0, axis], place - reach)
            drawn[1, axis] = max(drawn[1, axis], place + reach + 1)
        mark_scan(grid, params.cell, eye, ranges, bearings, params.reach)


@kernel(arrays=True)
def find_shortcut(
    occupancy: OccupancyGrids, i: int, search: SearchParams, home: np.ndarray
) -> None:
    """Find robot i's shortest way to `home` (map frame, m); unseen cells count as free."""
    _search_to(occupancy, i, search, home, occupancy.shortcuts[i])


@kernel(arrays=True)
def find_path(
    occupancy: OccupancyGrids, i: int, search: SearchParams, ahead: np.ndarray, known: float
) -> None:
    """Find robot i's way along the known way home, or by the shortcut.

    It takes the shortcut as a `Navigator` does: where that is worth leaving the known way, or that
    is barred. `ahead` (map frame, m) is the next point on the known way, of length `known` (m); NaN
    near home, and without a known way. The shortcut has been found before.
    """
    path, shortcut = occupancy.paths[i], occupancy.shortcuts[i]
    path[:] = shortcut
    if math.isnan(ahead[0]):
        return
    _search_to(occupancy, i, search, ahead, path)
    is_barred = _is_barred(occupancy, i, search, ahead, known)
    if (is_barred and not math.isnan(shortcut[0])) or _is_worth(shortcut, search, known):
        path[:] = shortcut
    elif math.isnan(path[0]):
        path[POINT] = ahead


@kernel(arrays=True)
def _is_barred(
    occupancy: OccupancyGrids, i: int, search: SearchParams, ahead: np.ndarray, known: float
) -> bool:
    """Whether robot i's known way home is barred: by a door that was shut meanwhile, for example.

    It is once its next point could often only be reached by a detour, and the robot has come no
    farther on it; until the robot has come farther. Where the point lies varies. `paths` holds the
    way to that point.
    """
    belief, barred = occupancy.beliefs[i], occupancy.barred[i]
    if known < barred[0] - _FARTHER:
        barred[0], barred[1] = known, 0.0
    straight = length_of(ahead[0] - belief[0], ahead[1] - belief[1])
    barred[1] += occupancy.paths[i, LENGTH] > search.worth * straight + _AT_HAND
    return bool(barred[1] >= _BARRED)


@kernel()
def _is_worth(shortcut: np.ndarray, search: SearchParams, known: float) -> bool:
    """Whether a shortcut is worth leaving the known way, of length `known` (m)."""
    return bool(search.worth * shortcut[LENGTH] < known)


@kernel(arrays=True)
def _search_to(
    occupancy: OccupancyGrids, i: int, search: SearchParams, goal: np.ndarray, way: np.ndarray
) -> None:
    """Fill in robot i's shortest `way` (3,) to a `goal` (map frame, m); unseen cells are free."""
    belief, grid = occupancy.beliefs[i], occupancy_of(occupancy, i)
    forget_way(way)
    start, end = cell_of(grid, belief, search.cell), cell_of(grid, goal, search.cell)
    low, high = box_around(grid, start, end, int(search.margin / search.cell))
    if not (is_inside(start, low, high, search) and is_inside(end, low, high, search)):
        return
    part = grid[low[0] : high[0], low[1] : high[1]].copy()
    before = np.empty(part.shape, np.int64)
    here, there = (start[0] - low[0], start[1] - low[1]), (end[0] - low[0], end[1] - low[1])
    ways, last = search_grid(part, here, search.radii, before, True, there)
    if last[0] < 0:  # It is believed to be in or beside an obstacle: end as near as possible.
        last = nearest_reached(ways, there[0], there[1], int(search.at_goal / search.cell))
    if last[0] < 0:
        return
    is_whole = tell_way(part, low, grid.shape[0] // 2, trace_path(ways, before, last), search, way)
    rest = STEP * length_of(last[0] - there[0], last[1] - there[1])
    way[LENGTH] = (ways[last] + rest) / STEP * search.cell
    if is_whole:
        way[0], way[1] = goal[0], goal[1]


@kernel(arrays=True)
def pick_shortcut(
    occupancy: OccupancyGrids, i: int, search: SearchParams, known: float
) -> np.ndarray:
    """Return the point ahead (map frame, m) on a way home that is worth leaving the known one.

    It is NaN unless the known way home, of length `known` (m), is much longer.
    """
    way = occupancy.shortcuts[i]
    return way[POINT] if _is_worth(way, search, known) else np.full(2, np.nan)


@kernel()
def tell_way(
    part: np.ndarray,
    low: tuple[int, int],
    half: int,
    cells: np.ndarray,
    search: SearchParams,
    way: np.ndarray,
) -> bool:
    """Fill in the point ahead on a way of `cells` of a part; return whether it is the way's end.

    Unknown cells on the way count as free in the line-of-sight test. `low` is the part's first
    cell, `half` the number of cells before the map's origin.
    """
    place = cells[0, 0] + 0.5, cells[0, 1] + 0.5
    sights = search.narrow / search.cell, search.ahead / search.cell
    chosen = farthest_straight(part, place, cells, sights, search.radii, True)
    way[0] = (cells[chosen, 1] + low[1] - half + 0.5) * search.cell
    way[1] = (cells[chosen, 0] + low[0] - half + 0.5) * search.cell
    return bool(chosen == cells.shape[0] - 1)


@kernel()
def cell_of(grid: np.ndarray, place: np.ndarray, cell: float) -> tuple[int, int]:
    """Return row and column of a position (map frame, m)."""
    half = grid.shape[0] // 2
    # The origin is a corner of cells: rounding must not decide which of them it belongs to.
    column, row = math.floor(place[0] / cell + 1e-6), math.floor(place[1] / cell + 1e-6)
    return row + half, column + half


@kernel()
def box_around(
    grid: np.ndarray, one: tuple[int, int], other: tuple[int, int], margin: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the first and last rows and columns around two cells, clipped to the grid."""
    side = grid.shape[0]
    low = max(0, min(one[0], other[0]) - margin), max(0, min(one[1], other[1]) - margin)
    high_row = min(side, max(one[0], other[0]) + margin + 1)
    high_column = min(side, max(one[1], other[1]) + margin + 1)
    return low, (high_row, high_column)


@kernel()
def is_inside(
    place: tuple[int, int], low: tuple[int, int], high: tuple[int, int], search: SearchParams
) -> bool:
    """Whether a cell of a part is one that a search may reach."""
    border = int(search.radii[1])
    rows = low[0] + border <= place[0] < high[0] - border
    return bool(rows and low[1] + border <= place[1] < high[1] - border)


@kernel(arrays=True)
def occupancy_of(occupancy: OccupancyGrids, i: int) -> np.ndarray:
    """Return a writable view of robot i's cells (side, side)."""
    side = occupancy.sides[i]
    return occupancy.grids[i, : side * side].reshape((side, side))


@kernel()
def forget_way(way: np.ndarray) -> None:
    """Mark a way as not found."""
    way[POINT] = math.nan
    way[LENGTH] = math.inf
