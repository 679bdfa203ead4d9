"""Geodesic distances: lengths of shortest paths for a robot that cannot pass through walls."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int32

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.types import Segments
from albot_core.planning.grid_search import FAR, first_anchor, search_any_angle
from albot_maps.lattice import Lattice


class DistanceField:
    """Lengths of the shortest paths from every point to a goal, for a disc of `radius` (m).

    A path runs straight from anchor to anchor (the points at which it turns) over a lattice, and
    from the last anchor to the goal. The length is exact where the goal is in sight, and a few
    centimetres too long at each corner. Paths use only lattice points that are at least the
    radius away from walls, so a gap that is less than one cell wider than the disc may count as
    closed. With `tight`, every gap that the disc can pass is open, but so are some gaps that are
    up to one and a half cells too narrow.

    Args:
        walls: Everything the disc must not touch.
        radius: The disc's radius (m).
        goal: Where the paths end (m).
        tight: Whether every gap that the disc can pass must be open.
    """

    def __init__(
        self,
        walls: Segments,
        radius: float,
        goal: Float64[np.ndarray, "2"],
        *,
        tight: bool = False,
    ) -> None:
        lattice = Lattice(walls)
        self.corner = lattice.corner
        """Position of the lattice's first point (m)."""
        self.cell = lattice.cell
        """Distance between neighbouring lattice points (m)."""
        self.columns, self.rows = lattice.shape
        state = lattice.blocked(radius - (self.cell * math.sqrt(0.5) if tight else 0.0))
        anchors = np.empty((len(state) + 1, 4))
        self.anchor_of: Int32[np.ndarray, "points"] = np.empty(len(state), np.int32)
        """The first anchor on the path from each point; `FAR` where there is no path."""
        x, y = ((goal - self.corner) / self.cell).tolist()
        count = search_any_angle(state, self.columns, self.rows, x, y, anchors, self.anchor_of)
        self.anchors: Float64[np.ndarray, "anchors 4"] = anchors[:count].copy()
        """Per anchor: x, y (cells), distance from the goal (cells), index of the next anchor."""

    def distance(self, position: Float64[np.ndarray, "2"]) -> float:
        """Return the shortest path's length (m) from a position (m); infinite if there is none."""
        anchor = self._anchor(position)
        if anchor == FAR:
            return math.inf
        x, y = ((position - self.corner) / self.cell).tolist()
        ahead = self.anchors[anchor]
        return float((ahead[2] + length_of(x - ahead[0], y - ahead[1])) * self.cell)

    def path(self, position: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "turns 2"]:
        """Return the turning points (m) of the shortest path from a position (m).

        The goal is the last. The array is empty if there is no path.
        """
        anchor, turns = self._anchor(position), []
        while anchor > 0:
            turns.append(self.anchors[anchor, :2])
            anchor = int(self.anchors[anchor, 3])
        if anchor == FAR:
            return np.empty((0, 2))
        places = np.array((*turns, self.anchors[0, :2]))
        return np.asarray(places * self.cell + self.corner)

    def _anchor(self, position: Float64[np.ndarray, "2"]) -> int:
        x, y = ((position - self.corner) / self.cell).tolist()
        return int(first_anchor(x, y, self.columns, self.rows, self.anchors, self.anchor_of))
