"""A quick proof that a robot gets somewhere, by flood fill of a lattice.

It errs on the safe side: what the fill reaches, a disc reaches; what it does not reach may
still be open, and only the exact `FreeSpace` can tell.
"""

from __future__ import annotations

import numpy as np
import shapely
from jaxtyping import Float64, Int, UInt8

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
        low, high = outline.min(axis=0), outline.max(axis=0)
        if _is_rectangle(outline):
            low, high = low + self._radius + _ROUNDING, high - self._radius - _ROUNDING
            return bool((self._within(low, high) == REACHED).any())
        points = np.argwhere(self._within(low, high) == REACHED) + self._first_within(low)
        inside = shapely.buffer(shapely.Polygon(outline), -self._radius)
        places = points * self._cell + self._corner
        return bool(shapely.contains_xy(inside, places).any())

    def _first_within(self, low: Float64[np.ndarray, "2"]) -> Int[np.ndarray, "2"]:
        """Column and row of the first lattice point not below `low` (m)."""
        first: Int[np.ndarray, "2"] = np.ceil((low - self._corner) / self._cell).astype(int)
        return np.maximum(first, 0)

    def _within(
        self, low: Float64[np.ndarray, "2"], high: Float64[np.ndarray, "2"]
    ) -> UInt8[np.ndarray, "columns rows"]:
        """The part of the lattice in a rectangle (m)."""
        left, bottom = self._first_within(low)
        right, top = np.maximum(np.floor((high - self._corner) / self._cell) + 1, 0).astype(int)
        return self._state[left:right, bottom:top]

    def _nearest(self, point: Float64[np.ndarray, "2"]) -> tuple[int, int]:
        """Column and row of the lattice point nearest to a point (m)."""
        column, row = np.round((point - self._corner) / self._cell).astype(int)
        return int(column), int(row)


def _is_rectangle(outline: Points) -> bool:
    """Whether an outline is four corners whose sides run along x and y in turn."""
    if len(outline) != 4:
        return False
    (x1, y1), (x2, y2), (x3, y3), (x4, y4) = outline.tolist()
    along_x = y1 == y2 and x2 == x3 and y3 == y4 and x4 == x1
    along_y = x1 == x2 and y2 == y3 and x3 == x4 and y4 == y1
    return bool(along_x or along_y)
