"""A quick proof that a robot gets somewhere, by flood fill of a lattice.

It errs on the safe side: what the fill reaches, a disc reaches; what it does not reach may
still be open, and only the exact `FreeSpace` can tell.
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.geometry.types import Points, Segments
from albot_maps.flood_kernel import REACHED, block, fill

_CELL = 0.1
"""Distance (m) of the lattice's points on floors of an ordinary size."""
_MOST_POINTS = 2_000_000
"""On a larger floor the points lie further apart."""
_ROUNDING = 1e-9
"""How far (m) inside a room the disc must lie, lest rounding decide."""


class FloodFill:
    """Where a disc of `radius` (m) surely gets to from a start.

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
        ends = walls.reshape(-1, 2)
        corner, far = ends.min(axis=0), ends.max(axis=0)
        self._cell = max(_CELL, float(np.sqrt(np.prod(far - corner) / _MOST_POINTS)))
        self._corner = corner
        columns, rows = (int(size) for size in np.ceil((far - corner) / self._cell) + 1)
        self._state = np.zeros((columns, rows), dtype=np.uint8)
        column, row = self._nearest(start)
        if 0 <= column < columns and 0 <= row < rows:
            self._fill(walls, column * rows + row)

    def _fill(self, walls: Segments, first: int) -> None:
        """Mark what is reached from the lattice point of a flat index."""
        columns, rows = self._state.shape
        clearance = self._radius + self._cell * np.sqrt(0.5)
        ends = (walls.reshape(-1, 2, 2) - self._corner) / self._cell
        low = np.maximum(np.ceil(ends.min(axis=1) - clearance / self._cell), 0)
        high = np.floor(ends.max(axis=1) + clearance / self._cell)
        high = np.minimum(high, (columns - 1, rows - 1))
        boxes = np.stack((low, high), axis=2).reshape(-1, 4).astype(np.int64)
        # A point may be put on the list by each of its four neighbours.
        waiting = np.empty(4 * self._state.size + 1, dtype=np.int64)
        waiting[0] = first
        x, y = self._corner.tolist()
        state = self._state.reshape(-1)
        block(state, rows, walls, boxes, x, y, self._cell, clearance)
        fill(state, rows, waiting)

    def reaches(self, point: Float64[np.ndarray, "2"]) -> bool:
        """Whether the disc's middle surely gets to a point (m)."""
        column, row = self._nearest(point)
        columns, rows = self._state.shape
        inside = 0 <= column < columns and 0 <= row < rows
        return inside and bool(self._state[column, row] == REACHED)

    def enters(self, outline: Points) -> bool:
        """Whether the disc surely gets to stand wholly inside an outline (m)."""
        (left, bottom), (right, top) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
        if _is_rectangle(outline):
            inset = self._radius + _ROUNDING
            columns = self._places(0, left + inset, right - inset)
            rows = self._places(1, bottom + inset, top - inset)
            return bool((self._state[columns, rows] == REACHED).any())
        inside = shapely.buffer(shapely.Polygon(outline), -self._radius)
        columns, rows = self._places(0, left, right), self._places(1, bottom, top)
        first = np.array([columns.start, rows.start])
        points = np.argwhere(self._state[columns, rows] == REACHED) + first
        places = points * self._cell + self._corner
        return bool(shapely.contains_xy(inside, places).any())

    def _nearest(self, point: Float64[np.ndarray, "2"]) -> tuple[int, int]:
        """Column and row of the lattice point nearest to a point (m)."""
        column, row = np.round((point - self._corner) / self._cell).astype(int)
        return int(column), int(row)

    def _places(self, axis: int, low: float, high: float) -> slice:
        """The lattice's columns (axis 0) or rows (axis 1) from `low` to `high` (m)."""
        begin = float(self._corner[axis])
        first = max(0, math.ceil((low - begin) / self._cell))
        return slice(first, max(first, math.floor((high - begin) / self._cell) + 1))


def _is_rectangle(outline: Points) -> bool:
    """Whether an outline is four corners whose sides run along x and y in turn."""
    if len(outline) != 4:
        return False
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = outline.tolist()
    along_x = y1 == y2 and x2 == x3 and y3 == y4 and x4 == x1
    along_y = x1 == x2 and y2 == y3 and x3 == x4 and y4 == y1
    return bool(along_x or along_y)
