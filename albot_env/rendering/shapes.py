"""Shapes, the primitives that every renderer draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from albot_core.maps.layers import OccupancyGridLayer

Kind = Literal["segments", "line", "dots", "marks", "grid", "cells", "home", "robot"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """One thing to draw."""

    kind: Kind
    """Meaning of `data`: segments `(n, 4)`; points `(n, 2)` of a line, of small dots or of larger
    marks; squares `(n, 4)`: centre x, y, side, and strength from 0 to 1; or one pose `(3,)`, which
    is the origin of a grid if there is one."""
    style: str
    """What the shape stands for; the renderer's palette maps it to a colour."""
    label: str
    """Its name in a legend."""
    data: Float64[np.ndarray, "..."]
    """Coordinates in the panel's frame (m)."""
    names: tuple[str, ...] = ()
    """Label beside each mark; empty for no labels."""
    radius: float = 0.0
    """Radius of a robot's body (m); 0 for a robot that is a point."""
    is_thin: bool = False
    """Whether a line is drawn thin, behind what matters more."""
    grid: OccupancyGridLayer | None = None
    """The cells of a grid; its own origin is ignored."""

    @property
    def points(self) -> Float64[np.ndarray, "points 2"]:
        """Points of the shape's outline (m)."""
        if self.grid is not None:
            return self.placed_grid.corners
        if self.kind == "cells":
            return self.data[:, :2]
        return self.data[:2].reshape(1, 2) if self.data.ndim == 1 else self.data.reshape(-1, 2)

    @property
    def placed_grid(self) -> OccupancyGridLayer:
        """The cells of a grid with their origin in the world frame."""
        assert self.grid is not None, "only grids have cells"
        return OccupancyGridLayer(
            origin=self.data, resolution=self.grid.resolution, occupancy=self.grid.occupancy
        )
