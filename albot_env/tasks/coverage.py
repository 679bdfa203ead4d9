"""Coverage: the ground that was in view at close range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from albot_core.errors import InputError
from albot_core.geometry.directions import angles_of
from albot_core.geometry.types import Pose
from albot_core.ranges import POSITIVE, check_fields
from albot_core.sensing.reading import LaserGeometry, LaserScan
from albot_env.tasks.ground import laid, no_ground
from albot_env.tasks.ground_kernels import (
    Ground,
    Sight,
    cover,
    find_frontier,
    is_time_to_look,
)
from albot_env.tasks.patch_kernels import cut_patch

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

    def sight(self, laser: LaserGeometry) -> Sight:
        """What such a laser shows of the ground, as the compiled loops take it."""
        # The middles of the parts into which `turned` divides the full turn.
        middles = angles_of((np.arange(_PARTS) + 0.5) * 4 / _PARTS - 2)
        bearings = middles - laser.mount[2] - laser.first_bearing
        half = laser.spacing / 2
        beams = np.floor(((bearings + half) % (2 * np.pi)) / laser.spacing).astype(np.int64)
        beams[beams >= laser.beams] = -1
        # A part is narrower than a quarter of a degree.
        ahead = float(np.cos(middles[beams >= 0]).min(initial=1.0)) - 0.01
        x, y, heading = (float(number) for number in laser.mount)
        first = heading + laser.first_bearing
        return Sight(self.radius, x, y, first, laser.spacing, beams, ahead)


class Coverage:
    """A square of ground, covered cell by cell.

    Kept once in the map's frame with the believed pose, for the agent to see, and once in
    the world's with the true one, for the reward. Ground beyond the square is never covered.

    Args:
        config: When ground counts as covered.
        extent: Half the side of the square (m).
        centre: The middle of the square x, y (m).
    """

    def __init__(
        self, config: CoverageConfig, extent: float, centre: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._config = config
        self._ground = laid(no_ground(1, config.cell), 0, config.side(extent), centre)
        self._cells = 0
        self._moved = np.full(2, np.inf)

    @property
    def ground(self) -> Ground:
        """The ground as the compiled loops take it."""
        return self._ground

    @property
    def area(self) -> float:
        """Ground covered (m²)."""
        return self._cells * self._config.cell**2

    def clear(self) -> None:
        """Uncover everything."""
        self._ground.grids.fill(0)
        self._cells = 0
        self._moved[:] = np.inf

    def add(self, pose: Pose, scan: LaserScan) -> float:
        """Cover the ground that a scan taken at `pose` shows; return how much is new (m²)."""
        config = self._config
        sight = config.sight(scan.geometry)
        new = cover(self._ground, 0, pose, _turn(pose), sight, scan.ranges)
        self._cells += new
        return new * config.cell**2

    def follow(self, motion: Pose, pose: Pose, scan: LaserScan) -> None:
        """Cover the ground that a scan shows where the robot has moved enough since the last.

        Args:
            motion: How it has moved since it was last followed.
            pose: Where it is.
            scan: What it sees there.
        """
        config = self._config
        if is_time_to_look(motion, config.spacing, config.turn, self._moved):
            self.add(pose, scan)

    def patch(self, pose: Pose) -> Float32[np.ndarray, "1 side side"]:
        """The cells around `pose`, turned with it: 1 covered, -1 not.

        Row 0 lies farthest ahead, column 0 farthest to the left.
        """
        config, width = self._config, self._config.patch_cells
        patch = np.empty(width * width, np.float32)
        cut_patch(self._ground, 0, pose, _turn(pose), config.patch_cell, width, patch)
        return patch.reshape(1, width, width)

    def frontier(self, pose: Pose, scan: LaserScan, sectors: int) -> Float64[np.ndarray, "sectors"]:
        """How far it is (m) in each sector of a scan, taken at `pose`, to ground not covered.

        As far as the middle beam of the sector shows: infinity where it shows none (B. Yamauchi,
        A frontier-based approach for autonomous exploration, CIRA 1997).
        """
        found = np.empty(sectors)
        sight = self._config.sight(scan.geometry)
        find_frontier(self._ground, 0, pose, sight, scan.ranges, found)
        return found


def _turn(pose: Pose) -> tuple[float, float]:
    """The cosine and sine of its heading."""
    return math.cos(pose[2]), math.sin(pose[2])
