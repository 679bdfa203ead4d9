"""Geodesic distances: lengths of shortest paths for a robot that cannot pass through walls."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int32, Int64

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.types import Segments
from albot_core.planning.any_angle_search import FAR, first_anchor, search_any_angle
from albot_maps.freespace import MARGIN
from albot_maps.lattice import Lattice


class DistanceField:
    """Lengths of the shortest paths from every point to a goal, for a disc of `radius` (m).

    A path runs straight from anchor to anchor (the points at which it turns) over a lattice, and
    from the last anchor to the goal. The length is exact where the goal is in sight, and a few
    centimetres too long at each corner. Paths use only lattice points that are at least the
    radius away from walls, so a gap that is less than one cell wider than the disc may count as
    closed. With `tight`, every gap that the disc can pass is open, but so are some gaps that are
    up to one and a half cells too narrow.

    If no walls enclose the goal, the lattice reaches beyond them, and paths lead from everywhere
    off the lattice to its edge.

    Args:
        walls: Everything the disc must not touch.
        radius: The disc's radius (m).
        goal: Where the paths end (m).
        spare: Distance that paths keep between disc and walls (m).
        tight: Whether every gap that the disc can pass must be open.
    """

    def __init__(
        self,
        walls: Segments,
        radius: float,
        goal: Float64[np.ndarray, "2"],
        *,
        spare: float = 0.0,
        tight: bool = False,
    ) -> None:
        clearance = radius + spare - (Lattice(walls).cell * math.sqrt(0.5) if tight else 0.0)
        self._search(Lattice(walls), clearance, goal)
        if self._is_open(goal):
            self._search(Lattice(walls, MARGIN * radius), clearance, goal)
            self._turn_at_edge()

    def _search(self, lattice: Lattice, clearance: float, goal: Float64[np.ndarray, "2"]) -> None:
        """Find the shortest paths over a lattice."""
        self.corner = lattice.corner
        """Position of the lattice's first point (m)."""
        self.cell = lattice.cell
        """Distance between neighbouring lattice points (m)."""
        self.columns, self.rows = lattice.shape
        state = lattice.blocked(clearance)
        anchors = np.empty((len(state) + 1, 4))
        self.anchor_of: Int32[np.ndarray, "points"] = np.empty(len(state), np.int32)
        """The first anchor on the path from each point; `FAR` where there is no path."""
        x, y = ((goal - self.corner) / self.cell).tolist()
        count = search_any_angle(state, self.columns, self.rows, x, y, anchors, self.anchor_of)
        self.anchors: Float64[np.ndarray, "anchors 4"] = anchors[:count].copy()
        """Per anchor: x, y (cells), distance from the goal (cells), index of the next anchor."""

    def _edge(self) -> Int64[np.ndarray, "edge"]:
        """Return the indices of the points on the edge of the lattice from which paths lead."""
        edge = np.ones((self.columns, self.rows), np.bool_)
        edge[1:-1, 1:-1] = False
        return np.flatnonzero(edge.ravel() & (self.anchor_of != FAR))

    def _is_open(self, goal: Float64[np.ndarray, "2"]) -> bool:
        """Return whether a path leads off the lattice, or the goal is off it."""
        column, row = ((goal - self.corner) / self.cell).tolist()
        inside = 0 <= column <= self.columns - 1 and 0 <= row <= self.rows - 1
        return not inside or len(self._edge()) > 0

    def _turn_at_edge(self) -> None:
        """Make the points on the edge anchors: a path from off the lattice may turn there."""
        edge = self._edge()
        places = np.stack((edge // self.rows, edge % self.rows), axis=1).astype(np.float64)
        ahead = self.anchor_of[edge]
        lengths = np.hypot(*(places - self.anchors[ahead, :2]).T) + self.anchors[ahead, 2]
        added = np.column_stack((places, lengths, ahead))
        self.anchor_of[edge] = len(self.anchors) + np.arange(len(edge))
        self.anchors = np.concatenate((self.anchors, added))

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
