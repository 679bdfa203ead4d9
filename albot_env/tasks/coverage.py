"""Coverage: the ground that was in view at close range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.perception.reading import LaserScan
from albot_env.tasks.kernels import cut_patch, sweep


@dataclass(frozen=True, kw_only=True)
class CoverageConfig:
    """When ground counts as covered, and how much of it an agent is shown."""

    radius: float = 2.0
    """Ground in view and no farther than this is covered (m): one must go there."""
    cell: float = 0.25
    """Side of a cell of ground (m)."""
    patch_cells: int = 32
    """Cells along each side of the egocentric patch."""
    patch_cell: float = 0.5
    """Side of a cell of the egocentric patch (m)."""

    def __post_init__(self) -> None:
        for name in ("radius", "cell", "patch_cell"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise InputError(f"CoverageConfig.{name}", "a positive length (m)", str(value))
        if self.patch_cells < 2:
            raise InputError("CoverageConfig.patch_cells", "at least 2", str(self.patch_cells))


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
        half = int(np.ceil(extent / config.cell))
        self._config = config
        self._centre = centre
        words = -(-2 * half // 64)
        self._grid: UInt64[np.ndarray, "side words"] = np.zeros((2 * half, words), np.uint64)
        self._cells = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows of cells, and words in a row (see `kernels`)."""
        rows, words = self._grid.shape
        return rows, words

    @property
    def centre(self) -> tuple[float, float]:
        """The middle of the square x, y (m)."""
        return self._centre

    @property
    def area(self) -> float:
        """Ground covered (m²)."""
        return self._cells * self._config.cell**2

    def clear(self) -> None:
        """Uncover everything."""
        self._grid.fill(0)
        self._cells = 0

    def add(self, pose: Pose, scan: LaserScan) -> float:
        """Cover the ground that a scan taken at `pose` shows; return how much is new (m²)."""
        geometry = scan.geometry
        new = sweep(
            self._grid,
            self._config.cell,
            self._centre,
            pose,
            geometry.mount[:2],
            scan.ranges,
            geometry.directions,
            geometry.spacing,
            self._config.radius,
        )
        self._cells += new
        return new * self._config.cell**2

    def patch(self, pose: Pose) -> Float32[np.ndarray, "1 side side"]:
        """The cells around `pose`, turned with it: 1 covered, -1 not.

        Row 0 lies farthest ahead, column 0 farthest to the left.
        """
        side = self._config.patch_cells
        patch = np.empty(side * side, np.float32)
        config = self._config
        cut_patch(self._grid, config.cell, self._centre, pose, config.patch_cell, side, patch)
        return patch.reshape(1, side, side)
