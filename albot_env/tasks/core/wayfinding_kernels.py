"""Compiled loops of wayfinding: the robots' occupancy grids, and the paths found on them.

At each step `update_occupancy` draws the robot's readings on its grid. Every few steps
`find_shortcut` and `find_onward` search the grid for paths; their results are kept until the
next search. `albot_core.planning.grid_search` defines the values of cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import compose, length_of, transform_point
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import (
    BLOCKED,
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
"""Columns of a way in `OccupancyGrids`: a point ahead on it, and its length."""
_NOWHERE = (-1, -1)
"""Goal of a search that ends at any wanted cell."""


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
    """(n, 3) float64: the same for the shortest way through cells seen to be free to uncovered
    ground."""
    paths: np.ndarray
    """(n, 3) float64: the same for the way home that the robot had better take: the shortcut if it
    is worth leaving the known way, else the shortest way to the next point on the known one."""


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
    new_share: float
    """Minimum share of new ground around a goal…"""
    about: float
    """…within a square of twice this side around it."""


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
        _draw(occupancy_of(occupancy, i), params, sensor, belief, ranges)
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
    _forget_way(occupancy.shortcuts[i])
    _forget_way(occupancy.onwards[i])
    _forget_way(occupancy.paths[i])


@kernel()
def _has_jumped(before: np.ndarray, motion: np.ndarray, now: np.ndarray, jump: float) -> bool:
    """Whether a belief differs from the odometry's prediction by more than `jump` (m)."""
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
    """Draw a scan if all of it is on the grid."""
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
    """Find robot i's shortest way to `home` (map frame, m); unseen cells count as free."""
    _search_to(occupancy, i, search, home, occupancy.shortcuts[i])


@kernel(arrays=True)
def find_path(
    occupancy: OccupancyGrids, i: int, search: SearchParams, ahead: np.ndarray, known: float
) -> None:
    """Find robot i's way along the known way home, or by the shortcut if it is worth it.

    It decides as a `Navigator` does, but takes no way for barred. `ahead` (map frame, m) is the
    next point on the known way, of length `known` (m); NaN near home, and without a known way. The
    shortcut has been found before.
    """
    path = occupancy.paths[i]
    path[:] = occupancy.shortcuts[i]
    if not (math.isnan(ahead[0]) or search.worth * path[LENGTH] < known):
        _search_to(occupancy, i, search, ahead, path)
        if math.isnan(path[0]):
            path[POINT] = ahead


@kernel(arrays=True)
def _search_to(
    occupancy: OccupancyGrids, i: int, search: SearchParams, goal: np.ndarray, way: np.ndarray
) -> None:
    """Fill in robot i's shortest `way` (3,) to a `goal` (map frame, m); unseen cells are free."""
    belief, grid = occupancy.beliefs[i], occupancy_of(occupancy, i)
    _forget_way(way)
    start, end = _cell(grid, belief, search.cell), _cell(grid, goal, search.cell)
    low, high = _box(grid, start, end, int(search.margin / search.cell))
    if not (_is_inside(start, low, high, search) and _is_inside(end, low, high, search)):
        return
    part = grid[low[0] : high[0], low[1] : high[1]].copy()
    before = np.empty(part.shape, np.int64)
    here, there = (start[0] - low[0], start[1] - low[1]), (end[0] - low[0], end[1] - low[1])
    ways, last = search_grid(part, here, search.radii, before, True, there)
    if last[0] < 0:  # It is believed to be in or beside an obstacle: end as near as possible.
        last = nearest_reached(ways, there[0], there[1], int(search.at_goal / search.cell))
    if last[0] < 0:
        return
    is_whole = _tell_way(part, low, grid.shape[0] // 2, trace_path(ways, before, last), search, way)
    rest = STEP * length_of(last[0] - there[0], last[1] - there[1])
    way[LENGTH] = (ways[last] + rest) / STEP * search.cell
    if is_whole:
        way[0], way[1] = goal[0], goal[1]


@kernel(arrays=True)
def find_onward(
    occupancy: OccupancyGrids, i: int, search: SearchParams, covered: CoverageGrid
) -> None:
    """Find robot i's shortest way, through cells seen to be free, to uncovered ground.

    Ground with much new ground around it comes first; if there is none, any uncovered ground.
    """
    _forget_way(occupancy.onwards[i])
    found = _search_onward(occupancy, i, search, covered, search.new_share)
    if not found and search.new_share > 0.0:
        _search_onward(occupancy, i, search, covered, 0.0)


@kernel(arrays=True)
def _search_onward(
    occupancy: OccupancyGrids, i: int, search: SearchParams, covered: CoverageGrid, least: float
) -> bool:
    """Find the shortest way to ground with at least this share of new ground around it, if any.

    The search starts with a small range, which is much faster, and doubles the range while it
    finds nothing and may be limited by the range. Late in an exploration it would search all that
    the robot knows, time and again, for what is not there. So a range without such ground is passed
    over, and before the first wider one it is tried whether there is any within reach.
    """
    way, grid = occupancy.onwards[i], occupancy_of(occupancy, i)
    start = _cell(grid, occupancy.beliefs[i], search.cell)
    around, goes_on = search.first, True
    while goes_on:
        low, high = _box(grid, start, start, int(around / search.cell))
        if not _is_inside(start, low, high, search):
            return False
        goes_on = around < search.last
        part = grid[low[0] : high[0], low[1] : high[1]].copy()
        if _mark_uncovered(part, low, grid.shape[0] // 2, search, covered, i, least):
            before = np.empty(part.shape, np.int64)
            here = start[0] - low[0], start[1] - low[1]
            ways, last = search_grid(part, here, search.radii, before, False, _NOWHERE)
            if last[0] >= 0:
                cells = trace_path(ways, before, last)
                _tell_way(part, low, grid.shape[0] // 2, cells, search, way)
                way[LENGTH] = ways[last] / STEP * search.cell
                return True
            goes_on = goes_on and _comes_to_the_edge(ways, int(search.radii[1]))
        if around == search.first:
            goes_on = goes_on and _may_reach_new(grid, start, search, covered, i, least)
        around = min(2 * around, search.last)
    return False


@kernel(arrays=True)
def pick_shortcut(
    occupancy: OccupancyGrids, i: int, search: SearchParams, known: float
) -> np.ndarray:
    """Return the point ahead (map frame, m) on a way home that is worth leaving the known one.

    It is NaN unless the known way home, of length `known` (m), is much longer.
    """
    way = occupancy.shortcuts[i]
    return way[POINT] if search.worth * way[LENGTH] < known else np.full(2, np.nan)


@kernel(arrays=True)
def pick_onward(occupancy: OccupancyGrids, i: int) -> np.ndarray:
    """Return the point ahead (map frame, m) on the way to uncovered ground; NaN for none."""
    return occupancy.onwards[i, POINT]


@kernel()
def _mark_uncovered(
    part: np.ndarray,
    low: tuple[int, int],
    half: int,
    search: SearchParams,
    covered: CoverageGrid,
    i: int,
    least: float,
) -> bool:
    """Mark the free cells of a part of a grid that are uncovered; return whether there are any.

    Only cells count that are inside the coverage grid and that a search could reach. Of the square
    around each, at least the share `least` must be new. `low` is the part's first cell; `half` is
    the number of cells before the map's origin.
    """
    extent, cell = covered.sides[i] / 2 * covered.cell, search.cell
    border, marks = int(search.radii[1]), False
    for row in range(border, part.shape[0] - border):
        y = (low[0] + row - half + 0.5) * cell
        for column in range(border, part.shape[1] - border):
            x = (low[1] + column - half + 0.5) * cell
            could_be = part[row, column] == FREE and max(abs(x), abs(y)) < extent
            if could_be and not is_covered(covered, i, x, y):
                place = row, column
                if _is_too_near(part, place, search.radii[0]):
                    continue  # `search_grid` ends at none of these.
                if _is_new_around(part, place, (x, y), search, covered, i, least):
                    part[row, column], marks = TARGET, True
    return marks


@kernel(arrays=True)
def _may_reach_new(
    grid: np.ndarray,
    start: tuple[int, int],
    search: SearchParams,
    covered: CoverageGrid,
    i: int,
    least: float,
) -> bool:
    """Whether the robot may reach ground with at least this share of new ground around it.

    If not, no search finds a way there. Robot i reaches the same cells by `search_grid` in the
    widest range. Obstacles are no new ground, but here they are taken for it: a narrower range does
    not see those beyond its edge.
    """
    low, high = _box(grid, start, start, int(search.last / search.cell))
    part, half = grid[low[0] : high[0], low[1] : high[1]], grid.shape[0] // 2
    rows, columns = part.shape
    border, extent = int(search.radii[1]), covered.sides[i] / 2 * covered.cell
    here, near = (start[0] - low[0], start[1] - low[1]), (search.radii[0] + 1) ** 2
    reached = np.zeros((rows, columns), np.bool_)
    waiting = np.empty(rows * columns, np.int32)
    waiting[0], count = here[0] * columns + here[1], 1
    reached[here] = True
    while count:
        count -= 1
        row, column = waiting[count] // columns, waiting[count] % columns
        x = (low[1] + column - half + 0.5) * search.cell
        y = (low[0] + row - half + 0.5) * search.cell
        could_be = part[row, column] == FREE and max(abs(x), abs(y)) < extent
        is_new = could_be and not is_covered(covered, i, x, y)
        if is_new and _is_new_around(part[:0], (row, column), (x, y), search, covered, i, least):
            return True
        for r in range(max(border, row - 1), min(rows - border, row + 2)):
            for c in range(max(border, column - 1), min(columns - border, column + 2)):
                if reached[r, c] or part[r, c] == BLOCKED:
                    continue
                is_free = part[r, c] == FREE and not _is_too_near(part, (r, c), search.radii[0])
                if is_free or (r - here[0]) ** 2 + (c - here[1]) ** 2 <= near:
                    reached[r, c] = True
                    waiting[count] = r * columns + c
                    count += 1
    return False


@kernel()
def _is_too_near(part: np.ndarray, place: tuple[int, int], radius: float) -> bool:
    """Whether a cell is so near a blocked one that `search_grid` ends at no target there."""
    around = int(radius)
    for row in range(max(0, place[0] - around), min(part.shape[0], place[0] + around + 1)):
        for column in range(max(0, place[1] - around), min(part.shape[1], place[1] + around + 1)):
            apart = (row - place[0]) ** 2 + (column - place[1]) ** 2
            if part[row, column] == BLOCKED and apart <= radius * radius:
                return True
    return False


@kernel()
def _is_new_around(
    part: np.ndarray,
    place: tuple[int, int],
    point: tuple[float, float],
    search: SearchParams,
    covered: CoverageGrid,
    i: int,
    least: float,
) -> bool:
    """Whether at least a share of the square around a cell is neither covered nor blocked.

    Of the square, only a grid of 5 × 5 points is looked at.
    """
    if least <= 0.0:
        return True
    new = 25
    for down in range(-2, 3):
        dy = down * search.about / 2
        row = place[0] + round(dy / search.cell)
        for right in range(-2, 3):
            dx = right * search.about / 2
            column = place[1] + round(dx / search.cell)
            inside = 0 <= row < part.shape[0] and 0 <= column < part.shape[1]
            blocked = inside and part[row, column] == BLOCKED
            new -= blocked or is_covered(covered, i, point[0] + dx, point[1] + dy)
            if new / 25 < least:
                return False
    return True


@kernel()
def _comes_to_the_edge(ways: np.ndarray, border: int) -> bool:
    """Whether a search reached the edge of its range, so that there may be more beyond."""
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
    """Fill in the point ahead on a way of `cells` of a part; return whether it is the way's end.

    Unknown cells on the way count as free in the line-of-sight test. `low` and `half` are as in
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
    """Return row and column of a position (map frame, m)."""
    half = grid.shape[0] // 2
    # The origin is a corner of cells: rounding must not decide which of them it belongs to.
    column, row = math.floor(place[0] / cell + 1e-6), math.floor(place[1] / cell + 1e-6)
    return row + half, column + half


@kernel()
def _box(
    grid: np.ndarray, one: tuple[int, int], other: tuple[int, int], margin: int
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the first and last rows and columns around two cells, clipped to the grid."""
    side = grid.shape[0]
    low = max(0, min(one[0], other[0]) - margin), max(0, min(one[1], other[1]) - margin)
    high_row = min(side, max(one[0], other[0]) + margin + 1)
    high_column = min(side, max(one[1], other[1]) + margin + 1)
    return low, (high_row, high_column)


@kernel()
def _is_inside(
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
def _forget_way(way: np.ndarray) -> None:
    """Mark a way as not found."""
    way[POINT] = math.nan
    way[LENGTH] = math.inf
