"""Coverage: the ground that was in view at close range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt64

from albot_core.geometry.pose_kernels import angles_from_pseudo
from albot_core.ranges import CELL, CELLS, POSITIVE, check_fields
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.coverage_kernels import (
    CoverageGrid,
    CoverageSensor,
)
from albot_maps import World

_PARTS = 2048
"""Number of parts of the full turn in the table that maps directions to beams."""


@dataclass(frozen=True, kw_only=True)
class CoverageConfig:
    """When ground counts as covered, and how large a patch of it is observed."""

    radius: float = 2.0
    """Ground in view within this distance of the laser is covered (m)."""
    cell: float = 0.25
    """Side of a cell of the coverage grid (m)."""
    spacing: float = 0.1
    """Coverage is updated each time the robot has moved this far (m)…"""
    turn: float = 0.1
    """…or turned this much (rad) since the last update."""
    patch_cells: int = 16
    """Number of cells along each side of the egocentric patch."""
    patch_cell: float = 0.5
    """Side of a cell of the egocentric patch (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "radius", "spacing", "turn")
        check_fields(self, CELL, "cell", "patch_cell")
        check_fields(self, CELLS, "patch_cells")

    def side(self, extent: float) -> int:
        """Return the cells along each side of a square that reaches `extent` (m) from its centre.

        The number is rounded up to a multiple of eight.
        """
        return 8 * int(np.ceil(extent / self.cell / 4))

    def sensor(self, laser: LaserGeometry) -> CoverageSensor:
        """Return a laser's field of view in the form that the compiled coverage loops take."""
        # The centres of the parts into which `pseudo_angle` divides the full turn.
        middles = angles_from_pseudo((np.arange(_PARTS) + 0.5) * 4 / _PARTS - 2)
        bearings = middles - laser.mount[2] - laser.first_bearing
        half = laser.spacing / 2
        beams = np.floor(((bearings + half) % (2 * np.pi)) / laser.spacing).astype(np.int64)
        beams[beams >= laser.beams] = -1
        # A part is narrower than a quarter of a degree.
        ahead = float(np.cos(middles[beams >= 0]).min(initial=1.0)) - 0.01
        x, y, heading = (float(number) for number in laser.mount)
        first = heading + laser.first_bearing
        return CoverageSensor(self.radius, x, y, first, laser.spacing, beams, ahead)


MARGIN = 5.0
"""Distance beyond the building's size up to which believed positions are kept (m)."""


def world_centre(world: World) -> tuple[float, float]:
    """Return the centre of the world (m)."""
    x_min, y_min, x_max, y_max = world.bounds
    return (x_min + x_max) / 2, (y_min + y_max) / 2


def world_extent(world: World) -> float:
    """Return how far (m) the world reaches from its centre along the axes."""
    x_min, y_min, x_max, y_max = world.bounds
    return max(x_max - x_min, y_max - y_min) / 2


def map_extent(world: World) -> float:
    """Return how far (m) a map can reach from its origin, wherever in the world the start is."""
    x_min, y_min, x_max, y_max = world.bounds
    return math.hypot(x_max - x_min, y_max - y_min) + MARGIN


def empty_coverage(robots: int, cell: float) -> CoverageGrid:
    """Return the coverage grids of `robots` robots, without cells; `cell` is the cell size (m)."""
    return CoverageGrid(
        grids=np.zeros((robots, 0), np.uint64),
        sides=np.zeros(robots, np.int64),
        centres=np.zeros((robots, 2)),
        cell=cell,
    )


def words_of(ground: CoverageGrid, row: int) -> UInt64[np.ndarray, "words"]:
    """Return a writable view of a robot's words."""
    words: UInt64[np.ndarray, "words"] = ground.grids[row, : (ground.sides[row] // 8) ** 2]
    return words


def with_coverage(
    ground: CoverageGrid, row: int, side: int, centre: tuple[float, float]
) -> CoverageGrid:
    """Return the grids with a new, uncovered one of `side` × `side` cells for one robot.

    The arrays are changed in place; larger ones are made only if needed.
    """
    words = (side // 8) ** 2
    robots, room = ground.grids.shape
    if words > room:
        added = np.zeros((robots, words - room), np.uint64)
        ground = ground._replace(grids=np.concatenate((ground.grids, added), axis=1))
    ground.grids[row] = 0
    ground.sides[row], ground.centres[row] = side, centre
    return ground
