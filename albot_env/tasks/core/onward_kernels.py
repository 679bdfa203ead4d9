"""Compiled search for the way onward: to where a look around shows most new ground for its length.

`find_onward` is called every few steps; its result is kept in `OccupancyGrids` until the next call.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import (
    BLOCKED,
    STEP,
    GridSearch,
    begin_search,
    expand,
    next_cell,
    trace_path,
)
from albot_env.tasks.core.coverage_kernels import CoverageGrid, is_covered
from albot_env.tasks.core.wayfinding_kernels import (
    LENGTH,
    NOWHERE,
    POINT,
    OccupancyGrids,
    SearchParams,
    box_around,
    cell_of,
    forget_way,
    is_inside,
    occupancy_of,
    tell_way,
)

_POINTS = 25
"""Number of points at which the ground around a place is looked at: 5 × 5 in a square."""
_WIDER = 4.0
"""Factor by which the range of a search is widened."""
_STRIDE = 2
"""Only every second cell along each axis may be where a way onward leads, which is faster."""
_ROUNDING = 1e-9
"""Difference between a gain and its bound that is due to rounding."""


@kernel(arrays=True)
def find_onward(
    occupancy: OccupancyGrids, i: int, search: SearchParams, covered: CoverageGrid
) -> None:
    """Find robot i's way, through cells seen to be free, that shows most new ground for its length.

    Of the cells that the robot can reach, it leads to that with the largest gain: the share of the
    ground in sight around it that is new, divided by the length of the way and `search.stay` (after
    H. González-Baños and J.-C. Latombe, Navigation strategies for exploring indoor environments,
    2002, section 4.3; there the gain decreases exponentially with the length). Cells beside the
    robot need not be seen to be free, so that it may turn round.

    The search starts with a small range, which is much faster, and widens it while a cell beyond it
    could have a larger gain.
    """
    way, grid = occupancy.onwards[i], occupancy_of(occupancy, i)
    forget_way(way)
    start = cell_of(grid, occupancy.beliefs[i], search.cell)
    around, most = search.first, 0.0
    while True:
        low, high = box_around(grid, start, start, int(around / search.cell))
        if not is_inside(start, low, high, search):
            return
        if around >= search.last:
            low, high = _drawn_box(occupancy.drawn[i], start, low, high, search.radii)
        part = grid[low[0] : high[0], low[1] : high[1]]
        before = np.empty(part.shape, np.int64)
        here = start[0] - low[0], start[1] - low[1]
        found = begin_search(part, here, search.radii, before, False, NOWHERE)
        enough = 0.0 if around >= search.last else 1.0 / (around + search.stay)
        best, most = _most_gain(grid, low, found, search, covered, i, most, enough)
        if best[0] >= 0:
            cells = trace_path(found.lengths, before, best)
            tell_way(part, low, grid.shape[0] // 2, cells, search, way)
            way[LENGTH] = found.lengths[best] / STEP * search.cell
        if most >= enough or not _comes_to_the_edge(found.lengths, int(search.radii[1])):
            return
        around = min(_WIDER * around, search.last)


@kernel()
def _drawn_box(
    drawn: np.ndarray,
    start: tuple[int, int],
    low: tuple[int, int],
    high: tuple[int, int],
    radii: tuple[float, float],
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the part of a box in which all ways from a start through cells seen to be free are.

    Around it there are as many cells as a search does not enter at the edges, and around the start
    as many as need not be seen to be free.
    """
    edge = int(radii[1]) + 1
    around = int(radii[0]) + 2 + edge
    first = min(drawn[0, 0] - edge, start[0] - around), min(drawn[0, 1] - edge, start[1] - around)
    last = max(drawn[1, 0] + edge, start[0] + around), max(drawn[1, 1] + edge, start[1] + around)
    low = max(low[0], first[0]), max(low[1], first[1])
    return low, (min(high[0], last[0]), min(high[1], last[1]))


@kernel()
def _comes_to_the_edge(ways: np.ndarray, border: int) -> bool:
    """Whether a search reached the edge of its range, so that there may be more beyond."""
    first, last = border, ways.shape[0] - 1 - border
    for k in range(first, last + 1):
        if max(ways[first, k], ways[last, k], ways[k, first], ways[k, last]) >= 0:
            return True
    return False


@kernel(arrays=True)
def _most_gain(
    grid: np.ndarray,
    low: tuple[int, int],
    found: GridSearch,
    search: SearchParams,
    covered: CoverageGrid,
    i: int,
    least: float,
    enough: float,
) -> tuple[tuple[int, int], float]:
    """Return the reachable cell with the largest gain, and the gain (1/m), if more than `least`.

    Of several, it is the first one row by row. `found` is a search that has begun in the part of
    the grid whose first cell is `low`. It takes the nearest cells first, and ends where no cell
    farther away can have a larger gain, unless the largest is less than `enough`: then the whole
    part is searched.
    """
    best, most, lines = NOWHERE, least, _lines_of_sight(search)
    while True:
        cell = next_cell(found)
        if cell[0] < 0:
            return best, most
        length = found.lengths[cell] / STEP * search.cell + search.stay
        if 1.0 / length < most and most >= enough:
            return best, most
        place, wanted = (low[0] + cell[0], low[1] + cell[1]), most * length - _ROUNDING
        if place[0] % _STRIDE == 0 and place[1] % _STRIDE == 0 and 1.0 / length >= most:
            gain = _new_share(grid, place, search, covered, i, wanted, lines) / length
            if gain > most or (gain == most and best[0] >= 0 and cell < best):
                best, most = cell, gain
        expand(found, cell, NOWHERE)


@kernel(arrays=True)
def _lines_of_sight(search: SearchParams) -> np.ndarray:
    """Return the cells on the lines from a place to the points around it, as seen from the place.

    The result has shape (`_POINTS`, cells, 2). Lines that have fewer cells end with (0, 0).
    """
    apart = _points_apart(search)
    lines = np.zeros((_POINTS, apart[4] + 1, 2), np.int32)
    for k in range(_POINTS):
        rows, columns = apart[k // 5], apart[k % 5]
        count = max(abs(rows), abs(columns))
        for j in range(count):
            lines[k, j, 0] = int(np.round(rows * (j + 1) / count))
            lines[k, j, 1] = int(np.round(columns * (j + 1) / count))
    return lines


@kernel()
def _points_apart(search: SearchParams) -> tuple[int, int, int, int, int]:
    """Return how far apart the points around a place are from it along an axis (cells)."""
    far = int(np.round(search.sight / search.cell))
    near = int(np.round(search.sight / 2 / search.cell))
    return -far, -near, 0, near, far


@kernel()
def _new_share(
    grid: np.ndarray,
    place: tuple[int, int],
    search: SearchParams,
    covered: CoverageGrid,
    i: int,
    least: float,
    lines: np.ndarray,
) -> float:
    """Return the share of the square around a cell that is new: not covered, and in sight.

    Where it is less than `least`, 0. Blocked cells hide what is behind them; a wall of which a
    grazing beam has erased cells does not hide what is behind those. Of the square, `_POINTS`
    points are looked at; what is beyond the coverage grid is not new.
    """
    side, extent = grid.shape[0], covered.sides[i] / 2 * covered.cell
    count, needed, found = _POINTS, least * _POINTS, 0
    apart = _points_apart(search)
    for k in range(_POINTS):
        row, column = place[0] + apart[k // 5], place[1] + apart[k % 5]
        x, y = (column - side // 2 + 0.5) * search.cell, (row - side // 2 + 0.5) * search.cell
        inside = 0 <= row < side and 0 <= column < side and max(abs(x), abs(y)) < extent
        if inside and grid[row, column] != BLOCKED and not is_covered(covered, i, x, y):
            found |= 1 << k
            continue
        count -= 1
        if count < needed:
            return 0.0
    for k in range(_POINTS):  # Lines take longer than points.
        if found >> k & 1 and not _is_in_sight(grid, place, lines[k]):
            count -= 1
            if count < needed:
                return 0.0
    return count / _POINTS


@kernel()
def _is_in_sight(grid: np.ndarray, place: tuple[int, int], line: np.ndarray) -> bool:
    """Whether no cell on a line of `_lines_of_sight` from a place is blocked."""
    j = 0
    while line[j, 0] or line[j, 1]:
        if grid[place[0] + line[j, 0], place[1] + line[j, 1]] == BLOCKED:
            return False
        j += 1
    return True


@kernel(arrays=True)
def pick_onward(occupancy: OccupancyGrids, i: int) -> np.ndarray:
    """Return the point ahead (map frame, m) on the way to uncovered ground; NaN for none."""
    return occupancy.onwards[i, POINT]
