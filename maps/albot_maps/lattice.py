"""A lattice of points over a floor, and which of them a robot can certainly reach."""

from __future__ import annotations

import math

import numpy as np
import shapely
from jaxtyping import Float64, UInt8

from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import BLOCKED, REACHED, flood_fill

_CELL = 0.1
"""Distance (m) between lattice points, on floors of ordinary size."""
_MOST_POINTS = 2_000_000
"""Largest number of lattice points; on larger floors they lie further apart."""
_ROUNDING = 1e-9
"""Margin (m) by which the disc must lie inside a room, so that rounding does not decide."""


class Lattice:
    """Points one cell apart, column by column, over the rectangle around all walls.

    Args:
        walls: The walls.
        margin: How far the rectangle reaches beyond the walls (m).
    """

    def __init__(self, walls: Segments, margin: float = 0.0) -> None:
        ends = walls.reshape(-1, 2)
        corner, far = ends.min(axis=0) - margin, ends.max(axis=0) + margin
        self._walls = walls
        self.corner: Float64[np.ndarray, "2"] = corner
        """Position of the first point (m)."""
        self.cell = max(_CELL, float(np.sqrt(np.prod(far - corner) / _MOST_POINTS)))
        """Distance between neighbouring points (m)."""
        columns, rows = np.ceil((far - corner) / self.cell) + 1
        self.shape = int(columns), int(rows)
        """Number of columns, and of points per column."""

    def blocked(self, clearance: float) -> UInt8[np.ndarray, "points"]:
        """Return `BLOCKED` for each point closer to a wall than `clearance` (m), 0 for others."""
        ends = (self._walls.reshape(-1, 2, 2) - self.corner) / self.cell
        low = np.maximum(np.ceil(ends.min(axis=1) - clearance / self.cell), 0)
        high = np.floor(ends.max(axis=1) + clearance / self.cell)
        high = np.minimum(high, np.subtract(self.shape, 1))
        boxes = np.stack((low, high), axis=2).reshape(-1, 4).astype(np.int64)
        columns, rows = self.shape
        state = np.zeros(columns * rows, np.uint8)
        x, y = self.corner.tolist()
        _block(state, rows, self._walls, boxes, x, y, self.cell, clearance)
        return state

    def nearest(self, point: Float64[np.ndarray, "2"]) -> tuple[int, int] | None:
        """Return column and row of the point nearest to a position (m); None off the lattice."""
        column, row = np.round((point - self.corner) / self.cell).astype(int).tolist()
        inside = 0 <= column < self.shape[0] and 0 <= row < self.shape[1]
        return (column, row) if inside else None

    def index_range(self, axis: int, low: float, high: float) -> slice:
        """Return the columns (axis 0) or rows (axis 1) from `low` to `high` (m)."""
        begin = float(self.corner[axis])
        first = max(0, math.ceil((low - begin) / self.cell))
        return slice(first, max(first, math.floor((high - begin) / self.cell) + 1))


@kernel()
def _block(
    state: np.ndarray,
    rows: int,
    walls: np.ndarray,
    boxes: np.ndarray,
    corner_x: float,
    corner_y: float,
    cell: float,
    clearance: float,
) -> None:
    """Mark the lattice points closer to a wall than `clearance`.

    Args:
        state: Zeros, column by column; written in place.
        rows: Number of points per column.
        walls: Segments (n, 4).
        boxes: For each wall the points to check (n, 4): first and last column, first and
            last row.
        corner_x: x of the first column (m).
        corner_y: y of the first row (m).
        cell: Distance between neighbouring points (m).
        clearance: Smallest allowed distance to a wall (m).
    """
    for index in range(len(walls)):
        x1, y1 = walls[index, 0], walls[index, 1]
        along_x, along_y = walls[index, 2] - x1, walls[index, 3] - y1
        squared = along_x * along_x + along_y * along_y
        for column in range(boxes[index, 0], boxes[index, 1] + 1):
            from_x = corner_x + column * cell - x1
            for row in range(boxes[index, 2], boxes[index, 3] + 1):
                from_y = corner_y + row * cell - y1
                share = (from_x * along_x + from_y * along_y) / squared
                if share < 0.0:
                    share = 0.0
                if share > 1.0:
                    share = 1.0
                gap_x, gap_y = from_x - share * along_x, from_y - share * along_y
                if gap_x * gap_x + gap_y * gap_y < clearance * clearance:
                    state[column * rows + row] = BLOCKED


class FloodFill:
    """Where a disc of `radius` (m) certainly gets from a start: a quick proof by flood fill.

    The disc reaches every point that the fill reaches. A point that the fill does not reach
    may still be reachable; only the exact `FreeSpace` can tell.

    Every point near the walls is within cell / √2 of its nearest lattice point. A lattice point
    is open if walls are at least the radius plus cell / √2 away. The straight lines from it to
    its four neighbours, and to every point whose nearest lattice point it is, are therefore
    clear of walls.

    Args:
        walls: Everything the disc must not touch.
        radius: The disc's radius (m).
        start: Where the disc starts (m).
    """

    def __init__(self, walls: Segments, radius: float, start: Float64[np.ndarray, "2"]) -> None:
        self._radius = radius
        self._lattice = lattice = Lattice(walls)
        first = lattice.nearest(start)
        if first is None:
            self._state = np.zeros(lattice.shape, np.uint8)
            return
        clearance = radius + lattice.cell * np.sqrt(0.5)
        state = lattice.blocked(clearance)
        # Each of a point's four neighbours may add it to the list.
        waiting = np.empty(4 * state.size + 1, dtype=np.int64)
        rows = lattice.shape[1]
        waiting[0] = first[0] * rows + first[1]
        flood_fill(state, rows, waiting)
        self._state = state.reshape(lattice.shape)

    def reaches(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Return whether the disc's centre certainly reaches a point (m)."""
        nearest = self._lattice.nearest(point)
        return nearest is not None and bool(self._state[nearest] == REACHED)

    def disc_fits_inside(self, outline: Points) -> bool:
        """Return whether the disc certainly reaches a position completely inside an outline (m)."""
        lattice = self._lattice
        (left, bottom), (right, top) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
        if _is_rectangle(outline):
            inset = self._radius + _ROUNDING
            columns = lattice.index_range(0, left + inset, right - inset)
            rows = lattice.index_range(1, bottom + inset, top - inset)
            return bool((self._state[columns, rows] == REACHED).any())
        inside = shapely.buffer(shapely.Polygon(outline), -self._radius)
        columns, rows = lattice.index_range(0, left, right), lattice.index_range(1, bottom, top)
        first = np.array([columns.start, rows.start])
        points = np.argwhere(self._state[columns, rows] == REACHED) + first
        places = points * lattice.cell + lattice.corner
        return bool(shapely.contains_xy(inside, places).any())


def _is_rectangle(outline: Points) -> bool:
    """Return whether an outline is a rectangle with sides parallel to the axes."""
    if len(outline) != 4:
        return False
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = outline.tolist()
    along_x = y1 == y2 and x2 == x3 and y3 == y4 and x4 == x1
    along_y = x1 == x2 and y2 == y3 and x3 == x4 and y4 == y1
    return bool(along_x or along_y)
