"""Coverage: the ground that was in view at close range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt64

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import angles_from_pseudo
from albot_core.ranges import POSITIVE, check_fields
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.coverage_kernels import (
    CoverageGrid,
    CoverageSensor,
)
from albot_maps import World

_PARTS = 2048
"""How finely the full turn is divided to look up the beam that points somewhere."""


@dataclass(frozen=True, kw_only=True)
class CoverageConfig:
    """When ground counts as covered, and how much of it an agent is shown."""

    radius: float = 2.0
    """Ground in view and no farther than this is covered (m): one must go there."""
    cell: float = 0.25
    """Side of a cell of ground (m)."""
    spacing: float = 0.1
    """How far the robot comes between two looks at the ground (m)…"""
    turn: float = 0.1
    """…unless it turns by this much before (rad)."""
    patch_cells: int = 16
    """Cells along each side of the egocentric patch."""
    patch_cell: float = 0.5
    """Side of a cell of the egocentric patch (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "radius", "cell", "patch_cell", "spacing", "turn")
        if self.patch_cells < 2:
            raise InputError("CoverageConfig.patch_cells", "at least 2", str(self.patch_cells))

    def side(self, extent: float) -> int:
        """Cells along each side of a square that reaches so far (m) from its middle, or more.

        A multiple of eight.
        """
        return 8 * int(np.ceil(extent / self.cell / 4))

    def sensor(self, laser: LaserGeometry) -> CoverageSensor:
        """What such a laser shows of the ground, as the compiled loops take it."""
        # The middles of the parts into which `pseudo_angle` divides the full turn.
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
"""How far beyond the building's own size a belief may stray and still be kept (m)."""


def world_centre(world: World) -> tuple[float, float]:
    """The middle of the world (m)."""
    x_min, y_min, x_max, y_max = world.bounds
    return (x_min + x_max) / 2, (y_min + y_max) / 2


def world_extent(world: World) -> float:
    """How far (m) from its middle the world reaches along the axes."""
    x_min, y_min, x_max, y_max = world.bounds
    return max(x_max - x_min, y_max - y_min) / 2


def map_extent(world: World) -> float:
    """How far (m) from its origin a map reaches, wherever in the world the robot set out."""
    x_min, y_min, x_max, y_max = world.bounds
    return math.hypot(x_max - x_min, y_max - y_min) + MARGIN


def empty_coverage(robots: int, cell: float) -> CoverageGrid:
    """The grids of so many robots, with cells of that size (m), none of which has any yet."""
    return CoverageGrid(
        grids=np.zeros((robots, 0), np.uint64),
        sides=np.zeros(robots, np.int64),
        centres=np.zeros((robots, 2)),
        cell=cell,
    )


def words_of(ground: CoverageGrid, row: int) -> UInt64[np.ndarray, "words"]:
    """A robot's own words, to be read and written."""
    words: UInt64[np.ndarray, "words"] = ground.grids[row, : (ground.sides[row] // 8) ** 2]
    return words


def with_coverage(
    ground: CoverageGrid, row: int, side: int, centre: tuple[float, float]
) -> CoverageGrid:
    """The grids, with an uncovered one of so many cells along a side for one robot.

    These are the same arrays, written over; larger ones only where that is needed.
    """
    words = (side // 8) ** 2
    robots, room = ground.grids.shape
    if words > room:
        added = np.zeros((robots, words - room), np.uint64)
        ground = ground._replace(grids=np.concatenate((ground.grids, added), axis=1))
    ground.grids[row] = 0
    ground.sides[row], ground.centres[row] = side, centre
    return ground
