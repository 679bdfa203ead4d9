"""Geodesic distances: how far it is home for a robot that cannot drive through walls."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int32

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.types import Segments
from albot_core.planning.grid_search import FAR, first_anchor, search_any_angle
from albot_maps.lattice import Lattice


class DistanceField:
    """The length of the shortest way to a goal from everywhere, for a disc of `radius` (m).

    Ways lead straight over a lattice from anchor to anchor, which are points at which they
    turn, and from the last one to the goal. Where the goal is in sight the length is exact;
    at each corner on the way it is a few centimetres too long. Ways keep to points of the lattice
    that are at least the radius away from walls. So a gap less than a cell wider than the disc may
    be closed. With `tight` no gap that the disc can pass is closed, but some are open that are
    up to a cell and a half too narrow.

    Args:
        walls: Everything the disc must not touch.
        radius: Its radius (m).
        goal: Where ways lead (m).
        tight: Whether no gap that the disc can pass may be closed.
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
        """Where the lattice's first point lies (m)."""
        self.cell = lattice.cell
        """Distance of its points (m)."""
        self.columns, self.rows = lattice.shape
        state = lattice.blocked(radius - (self.cell * math.sqrt(0.5) if tight else 0.0))
        anchors = np.empty((len(state) + 1, 4))
        self.anchor_of: Int32[np.ndarray, "points"] = np.empty(len(state), np.int32)
        """The first anchor on the way from each point; `FAR` where there is no way."""
        x, y = ((goal - self.corner) / self.cell).tolist()
        count = search_any_angle(state, self.columns, self.rows, x, y, anchors, self.anchor_of)
        self.anchors: Float64[np.ndarray, "anchors 4"] = anchors[:count].copy()
        """x, y of each anchor, its distance from the goal (cells), and the next one."""

    def distance(self, place: Float64[np.ndarray, "2"]) -> float:
        """Length (m) of the shortest way from a place (m) to the goal; infinite without one."""
        anchor = self._anchor(place)
        if anchor == FAR:
            return math.inf
        x, y = ((place - self.corner) / self.cell).tolist()
        ahead = self.anchors[anchor]
        return float((ahead[2] + length_of(x - ahead[0], y - ahead[1])) * self.cell)

    def way(self, place: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "turns 2"]:
        """Where the shortest way from a place (m) turns, the goal last; empty without one."""
        anchor, turns = self._anchor(place), []
        while anchor > 0:
            turns.append(self.anchors[anchor, :2])
            anchor = int(self.anchors[anchor, 3])
        if anchor == FAR:
            return np.empty((0, 2))
        places = np.array((*turns, self.anchors[0, :2]))
        return np.asarray(places * self.cell + self.corner)

    def _anchor(self, place: Float64[np.ndarray, "2"]) -> int:
        x, y = ((place - self.corner) / self.cell).tolist()
        return int(first_anchor(x, y, self.columns, self.rows, self.anchors, self.anchor_of))
