"""What renderers draw: shapes that each draws in its own way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from albot_core.maps.layers import OccupancyGridLayer

Kind = Literal["segments", "line", "dots", "marks", "grid", "cells", "home", "robot"]

ROBOT_RADIUS = 0.25
"""Radius at which the robot is drawn (m): about a Pioneer's."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """Something to draw."""

    kind: Kind
    """How `data` is meant: segments `(n, 4)`; points `(n, 2)` of a line, of small dots or of larger
    marks; squares `(n, 4)`, each its middle, its side, and how strongly it is drawn, from 0 to 1;
    or one pose `(3,)`, of a grid its origin."""
    style: str
    """What it stands for; the renderer's palette gives it a colour."""
    label: str
    """Its name in a legend."""
    data: Float64[np.ndarray, "..."]
    """Coordinates in the panel's frame (m)."""
    names: tuple[str, ...] = ()
    """What stands beside each mark; nothing where there are none."""
    grid: OccupancyGridLayer | None = None
    """The cells, of a grid; its own origin does not count."""

    @property
    def points(self) -> Float64[np.ndarray, "points 2"]:
        """Points of its outline (m)."""
        if self.grid is not None:
            return self.placed_grid.corners
        if self.kind == "cells":
            return self.data[:, :2]
        return self.data[:2].reshape(1, 2) if self.data.ndim == 1 else self.data.reshape(-1, 2)

    @property
    def placed_grid(self) -> OccupancyGridLayer:
        """The cells, of a grid, with their origin in the world's frame."""
        assert self.grid is not None, "only grids have cells"
        return OccupancyGridLayer(
            origin=self.data, resolution=self.grid.resolution, occupancy=self.grid.occupancy
        )
