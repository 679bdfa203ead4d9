"""A quick proof that a robot gets somewhere, by flood fill of a lattice.

It errs on the safe side: what the fill reaches, a disc reaches; what it does not reach may
still be open, and only the exact `FreeSpace` can tell.
"""

from __future__ import annotations

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.geometry.types import Points, Segments
from albot_maps.flood_kernel import REACHED, fill
from albot_maps.lattice import Lattice

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
        fill(state, rows, waiting)
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
