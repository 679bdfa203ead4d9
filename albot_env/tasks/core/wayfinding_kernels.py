"""The compiled loops of wayfinding: occupancy grids of robots, and the ways found on them.

At each step `update_occupancy` draws what a robot sees on its grid; every few steps
`find_shortcut` and `find_onward` search the grid for ways, and what they found is kept until the
next search. What the cells can be, see `albot_core.planning.grid_search`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import compose, length_of, transform_point
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import (
    FREE,
    STEP,
    TARGET,
    nearest_reached,
    search_grid,
    trace_path,
)
from albot_core.planning.occupancy_grid_kernels import farthest_straight, mark_scan
from albot_env.tasks.core.coverage_kernels import (
    CoverageGrid,
    CoverageSensor,
    accumulate_motion,
    is_covered,
)

POINT, LENGTH = slice(0, 2), 2
"""What `OccupancyGrids` holds of a way: a point ahead on it, and how long it is."""
_NOWHERE = (-1, -1)
"""The goal of a search for wanted cells."""


class OccupancyParams(NamedTuple):
    """How occupancy grids are drawn."""

    cell: float
    """Side of a cell (m)."""
    reach: float
    """What lies farther away is not drawn (m)."""
    jump: float
    """A belief that moves farther than this (m) from what the odometer says clears the grid."""
    spacing: float
    """How far the robot comes between two looks (m)…"""
    turn: float
    """…unless it turns by this much before (rad)."""
    every: int
    """Steps from each search for ways to the next."""


class OccupancyGrids(NamedTuple):
    """What robots have seen of the ground (map frames), and the ways found on it; a row each."""

    grids: np.ndarray
    """(n, cells) int8: what each cell is, row by row, x along a row."""
    sides: np.ndarray
    """(n,) int64: cells along each side; the map's origin is in the middle."""
    ages: np.ndarray
    """(n,) int64: steps since each was begun."""
    moved: np.ndarray
    """(n, 2) float64: way and turning since each was drawn on last (m, rad)."""
    beliefs: np.ndarray
    """(n, 3) float64: where each robot believed to be at the last step (map frame)."""
    shortcuts: np.ndarray
    """(n, 3) float64: the point ahead on the shortest way home that is not known to be barred
    (map frame, m), and how long that way is, close to things twice as long (m); NaN and
    infinite where there is none."""
    onwards: np.ndarray
    """(n, 3) float64: the same of the shortest way, over ground seen to be free, to ground that
    is not covered."""


class SearchParams(NamedTuple):
    """How ways are searched for (see `WayfindingConfig`); lengths in m."""

    cell: float
    radii: tuple[float, float]
    """How near ways come to what is blocked, and where they are twice as long, in cells."""
    margin: float
    first: float
    last: float
    narrow: float
    """Stretches shorter than this may lead close past things."""
    ahead: float
    at_goal: float
    """A way that ends no farther from home than this leads there."""
    worth: float


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
    """Draw what robot i sees; return whether it is time to search for ways.

    A belief that has jumped begins an empty grid: what is drawn is not where it was.
    """
    if occupancy.ages[i] and _has_jumped(occupancy.beliefs[i], motion, belief, params.jump):
        clear_occupancy(occupancy, i)
    for k in range(belief.shape[0]):
        occupancy.beliefs[i, k] = belief[k]
    if accumulate_motion(motion, params.spacing, params.turn, occupancy.moved[i]):
        _draw(occupancy_of(occupancy, i), params, sensor, belief, ranges)
    is_time = occupancy.ages[i] % params.every == 0
    occupancy.ages[i] += 1
    return bool(is_time)


@kernel()
def clear_occupancy(occupancy: OccupancyGrids, i: int) -> None:
    """Let robot i know nothing of the ground."""
    side = occupancy.sides[i]
    occupancy.grids[i, : side * side] = 0
    occupancy.ages[i] = 0
    occupancy.moved[i] = math.inf
    _forget_way(occupancy.shortcuts[i])
    _forget_way(occupancy.onwards[i])


@kernel()
def _has_jumped(before: np.ndarray, motion: np.ndarray, now: np.ndarray, jump: float) -> bool:
    """Whether a belief is elsewhere than the odometer's motion leads to."""
    x, y, _ = compose(before, motion)
    return length_of(now[0] - x, now[1] - y) > jump


@kernel(arrays=True)
def _draw(
    grid: np.ndarray,
    params: OccupancyParams,
    sensor: CoverageSensor,
    belief: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Draw a scan, where all of it is on the grid."""
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    x, y = transform_point(belief, cos, sin, sensor.x, sensor.y)
    eye = np.array((x, y, belief[2] + sensor.first))
    farthest = max(abs(eye[0]), abs(eye[1])) + params.reach + params.cell
    if farthest < (grid.shape[0] // 2) * params.cell:
        bearings = np.arange(ranges.shape[0]) * sensor.spacing
        mark_scan(grid, params.cell, eye, ranges, bearings, params.reach)


@kernel(arrays=True)
def find_shortcut(
    occupancy: OccupancyGrids, i: int, search: SearchParams, home: np.ndarray
) -> None:
    """Find robot i's shortest way home (map frame, m); ground not seen yet counts as free."""
    way, belief, grid = occupancy.shortcuts[i], occupancy.beliefs[i], occupancy_of(occupancy, i)
    _forget_way(way)
    start, end = _cell(grid, belief, search.cell), _cell(grid, home, search.cell)
    low, high = _box(grid, start, end, int(search.margin / search.cell))
    if not (_is_inside(start, low, high, search) and _is_inside(end, low, high, search)):
        return
    part = grid[low[0] : high[0], low[1] : high[1]].copy()
    before = np.empty(part.shape, np.int64)
    here, goal = (start[0] - low[0], start[1] - low[1]), (end[0] - low[0], end[1] - low[1])
    ways, last = search_grid(part, here, search.radii, before, True, goal)
    if last[0] < 0:  # Home is believed to be in or beside something: as near by as can be.
        last = nearest_reached(ways, goal[0], goal[1], int(search.at_goal / search.cell))
    if last[0] < 0:
        return
    is_whole = _tell_way(part, low, grid.shape[0] // 2, trace_path(ways, before, last), search, way)
    rest = STEP * length_of(last[0] - goal[0], last[1] - goal[1])
    way[LENGTH] = (ways[last] + rest) / STEP * search.cell
    if is_whole:
        way[0], way[1] = home[0], home[1]


@kernel(arrays=True)
def find_onward(
    occupancy: OccupancyGrids, i: int, search: SearchParams, covered: CoverageGrid
) -> None:
    """Find robot i's shortest way, over ground seen to be free, to ground not covered.

    It looks near by first, which is much faster, and twice as far where all of that is covered
    and there is more beyond.
    """
    way, grid = occupancy.onwards[i], occupancy_of(occupancy, i)
    _forget_way(way)
    start = _cell(grid, occupancy.beliefs[i], search.cell)
    around, goes_on = search.first, True
    while goes_on:
        low, high = _box(grid, start, start, int(around / search.cell))
        if not _is_inside(start, low, high, search):
            return
        part = grid[low[0] : high[0], low[1] : high[1]].copy()
        _mark_uncovered(part, low, grid.shape[0] // 2, search.cell, covered, i)
        before = np.empty(part.shape, np.int64)
        here = start[0] - low[0], start[1] - low[1]
        ways, last = search_grid(part, here, search.radii, before, False, _NOWHERE)
        if last[0] >= 0:
            _tell_way(part, low, grid.shape[0] // 2, trace_path(ways, before, last), search, way)
            way[LENGTH] = ways[last] / STEP * search.cell
            return
        goes_on = around < search.last and _comes_to_the_edge(ways, int(search.radii[1]))
        around = min(2 * around, search.last)


@kernel(arrays=True)
def pick_shortcut(
    occupancy: OccupancyGrids, i: int, search: SearchParams, known: float
) -> np.ndarray:
    """The point ahead (map frame, m) on a way home that is worth leaving the known one for.

    It is NaN where the known way home, so long (m), is not much longer.
    """
    way = occupancy.shortcuts[i]
    return way[POINT] if search.worth * way[LENGTH] < known else np.full(2, np.nan)


@kernel(arrays=True)
def pick_onward(occupancy: OccupancyGrids, i: int) -> np.ndarray:
    """The point ahead (map frame, m) on the way to ground not covered; NaN for none."""
    return occupancy.onwards[i, POINT]


@kernel()
def _mark_uncovered(
    part: np.ndarray, low: tuple[int, int], half: int, cell: float, covered: CoverageGrid, i: int
) -> None:
    """Mark the free cells of a part of a grid that are not covered, and could be.

    `low` is the part's first cell, `half` how many cells before the map's origin the grid begins.
    """
    extent = covered.sides[i] / 2 * covered.cell
    for row in range(part.shape[0]):
        y = (low[0] + row - half + 0.5) * cell
        for column in range(part.shape[1]):
            x = (low[1] + column - half + 0.5) * cell
            could_be = part[row, column] == FREE and max(abs(x), abs(y)) < extent
            if could_be and not is_covered(covered, i, x, y):
                part[row, column] = TARGET


@kernel()
def _comes_to_the_edge(ways: np.ndarray, border: int) -> bool:
    """Whether a search came to the edge of where it may: there may be more beyond."""
    first, last = border, ways.shape[0] - 1 - border
    for k in range(first, last + 1):
        if max(ways[first, k], ways[last, k], ways[k, first], ways[k, last]) >= 0:
            return True
    return False


@kernel()
def _tell_way(
    part: np.ndarray,
    low: tuple[int, int],
    half: int,
    cells: np.ndarray,
    search: SearchParams,
    way: np.ndarray,
) -> bool:
    """Fill in the point ahead on a way of `cells` of a part; whether that is its end.

    Unknown cells that the way leads over are free to look across. `low` and `half` are as for
    `_mark_uncovered`.
    """
    place = cells[0, 0] + 0.5, cells[0, 1] + 0.5
    sights = search.narrow / search.cell, search.ahead / search.cell
    chosen = farthest_straight(part, place, cells, sights, search.radii, True)
    way[0] = (cells[chosen, 1] + low[1] - half + 0.5) * search.cell
    way[1] = (cells[chosen, 0] + low[0] - half + 0.5) * search.cell
    return bool(chosen == cells.shape[0] - 1)


@kernel()
def _cell(grid: np.ndarray, place: np.ndarray, cell: float) -> tuple[int, int]:
    """Row and column of a place (map frame, m)."""
    half = grid.shape[0] // 2
    # The origin is a corner of cells: rounding must not decide in which of them it is.
    column, row = math.floor(place[0] / cell + 1e-6), math.floor(place[1] / cell + 1e-6)
    return row + half, column + half


@kernel()
def _box(
    grid: np.ndarray, one: tuple[int, int], other: tuple[int, int], margin: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """First and last rows and columns about two cells, as far as the grid reaches."""
    side = grid.shape[0]
    low = max(0, min(one[0], other[0]) - margin), max(0, min(one[1], other[1]) - margin)
    high_row = min(side, max(one[0], other[0]) + margin + 1)
    high_column = min(side, max(one[1], other[1]) + margin + 1)
    return low, (high_row, high_column)


@kernel()
def _is_inside(
    place: tuple[int, int], low: tuple[int, int], high: tuple[int, int], search: SearchParams
) -> bool:
    """Whether a cell is where a search may come to in a part."""
    border = int(search.radii[1])
    rows = low[0] + border <= place[0] < high[0] - border
    return bool(rows and low[1] + border <= place[1] < high[1] - border)


@kernel(arrays=True)
def occupancy_of(occupancy: OccupancyGrids, i: int) -> np.ndarray:
    """Robot i's cells (side, side), to be read and written."""
    side = occupancy.sides[i]
    return occupancy.grids[i, : side * side].reshape((side, side))


@kernel()
def _forget_way(way: np.ndarray) -> None:
    """Write that there is no such way."""
    way[POINT] = math.nan
    way[LENGTH] = math.inf
