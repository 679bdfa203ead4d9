"""The lattice of points laid over a floor, on which ways are looked for."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, UInt8

from albot_core.geometry.types import Segments
from albot_maps.flood_kernel import block

_CELL = 0.1
"""Distance (m) of the lattice's points on floors of an ordinary size."""
_MOST_POINTS = 2_000_000
"""On a larger floor the points lie further apart."""


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
        block(state, rows, self._walls, boxes, x, y, self.cell, clearance)
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
