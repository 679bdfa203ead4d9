"""The lattice of points laid over a floor, and where on it a robot surely gets to."""

from __future__ import annotations

import math

import numpy as np
import shapely
from jaxtyping import Float64, UInt8

from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import BLOCKED, REACHED, flood_fill

_CELL = 0.1
"""Distance (m) of the lattice's points on floors of an ordinary size."""
_MOST_POINTS = 2_000_000
"""On a larger floor the points lie further apart."""
_ROUNDING = 1e-9
"""How far (m) inside a room the disc must lie, lest rounding decide."""


class Lattice:
    """Points a cell apart, column by column, over everything that the walls enclose.

    Args:
        walls: The walls.
    """

    def __init__(self, walls: Segments) -> None:
        ends = walls.reshape(-1, 2)
        corner, far = ends.min(axis=0), ends.max(axis=0)
        self._walls = walls
        self.corner: Float64[np.ndarray, "2"] = corner
        """Where the first point lies (m)."""
        self.cell = max(_CELL, float(np.sqrt(np.prod(far - corner) / _MOST_POINTS)))
        """Distance of neighbouring points (m)."""
        columns, rows = np.ceil((far - corner) / self.cell) + 1
        self.shape = int(columns), int(rows)
        """How many columns, and points in each."""

    def blocked(self, clearance: float) -> UInt8[np.ndarray, "points"]:
        """`BLOCKED` for each point nearer than this (m) to a wall, 0 for all others."""
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
        """Column and row of the point nearest to a place (m); None where it is off the lattice."""
        column, row = np.round((point - self.corner) / self.cell).astype(int).tolist()
        inside = 0 <= column < self.shape[0] and 0 <= row < self.shape[1]
        return (column, row) if inside else None

    def places(self, axis: int, low: float, high: float) -> slice:
        """The columns (axis 0) or rows (axis 1) from `low` to `high` (m)."""
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
    """Mark the lattice points nearer to a wall than `clearance`.

    Args:
        state: Zeros, column by column, filled in.
        rows: How many there are in a column.
        walls: Segments (n, 4).
        boxes: For each wall the points to look at (n, 4): the first and the last column,
            the first and the last row.
        corner_x: Where the first column lies.
        corner_y: Where the first row lies.
        cell: Distance of neighbouring points.
        clearance: How near a wall may be.
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
    """Where a disc of `radius` (m) surely gets to from a start: a quick proof, by flood fill.

    It errs on the safe side: what the fill reaches, the disc reaches. What it does not reach may
    still be open, and only the exact `FreeSpace` can tell.

    No point of the plane is further than cell / √2 from the lattice's nearest. A lattice
    point is open where the walls are at least the radius and that much away, so the
    straight ways from it to its four neighbours, and to any point to which it is the
    nearest, are clear of walls.

    Args:
        walls: Everything the disc must not touch.
        radius: Its radius (m).
        start: Where it sets out (m).
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
        # A point may be put on the list by each of its four neighbours.
        waiting = np.empty(4 * state.size + 1, dtype=np.int64)
        rows = lattice.shape[1]
        waiting[0] = first[0] * rows + first[1]
        flood_fill(state, rows, waiting)
        self._state = state.reshape(lattice.shape)

    def reaches(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Whether the disc's middle surely gets to a point (m)."""
        nearest = self._lattice.nearest(point)
        return nearest is not None and bool(self._state[nearest] == REACHED)

    def enters(self, outline: Points) -> bool:
        """Whether the disc surely gets to stand wholly inside an outline (m)."""
        lattice = self._lattice
        (left, bottom), (right, top) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
        if _is_rectangle(outline):
            inset = self._radius + _ROUNDING
            columns = lattice.places(0, left + inset, right - inset)
            rows = lattice.places(1, bottom + inset, top - inset)
            return bool((self._state[columns, rows] == REACHED).any())
        inside = shapely.buffer(shapely.Polygon(outline), -self._radius)
        columns, rows = lattice.places(0, left, right), lattice.places(1, bottom, top)
        first = np.array([columns.start, rows.start])
        points = np.argwhere(self._state[columns, rows] == REACHED) + first
        places = points * lattice.cell + lattice.corner
        return bool(shapely.contains_xy(inside, places).any())


def _is_rectangle(outline: Points) -> bool:
    """Whether an outline is four corners whose sides run along x and y in turn."""
    if len(outline) != 4:
        return False
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = outline.tolist()
    along_x = y1 == y2 and x2 == x3 and y3 == y4 and x4 == x1
    along_y = x1 == x2 and y2 == y3 and x3 == x4 and y4 == y1
    return bool(along_x or along_y)
