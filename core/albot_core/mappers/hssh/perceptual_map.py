"""The local perceptual map: an occupancy grid that scrolls with the robot (section 4 there)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int8

from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.gateways import FREE, UNKNOWN, WALL, Ground
from albot_core.mappers.schema import Schema
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.tiles import NONE, release_tiles, tiles_around
from albot_core.mappers.stored import Stored
from albot_core.maps.layers import OccupancyGridLayer
from albot_core.sensing.reading import LaserScan


class LocalPerceptualMap(Stored):
    """What was seen of the ground around the robot, in the frame of the odometry.

    Args:
        config: The cells, and the sensor model.
        half: Half the side of the square that is kept (m).
    """

    SCHEMA = Schema(parts=("grid",))

    def __init__(self, config: GridConfig, half: float) -> None:
        self.grid, self._half = LogOddsGrid(config), half

    def clear(self) -> None:
        """Forget all ground."""
        self.grid = LogOddsGrid(self.grid.config)

    def integrate(self, pose: Pose, scan: LaserScan) -> None:
        """Enter a scan at the robot's pose, and forget the ground that lies too far away."""
        self._scroll(pose)
        self.grid.integrate(pose, scan)

    def _scroll(self, pose: Pose) -> None:
        """Release the tiles that do not touch the square around the robot."""
        grid = self.grid
        if not grid.index.size:
            return
        half = max(self._half, grid.config.reach)
        low, high = tiles_around(float(pose[0]), float(pose[1]), half, grid.config.cell)
        first = np.clip(low - grid.corner, 0, grid.index.shape)
        last = np.clip(high - grid.corner, first, grid.index.shape)
        if tuple(last - first) == grid.index.shape:
            return
        inside = slice(first[0], last[0]), slice(first[1], last[1])
        kept = grid.index[inside].copy()
        grid.index[inside] = NONE
        release_tiles(grid.pool.arrays, grid.index)
        grid.index, grid.corner = kept, grid.corner + first
        if not kept.size:
            grid.clear()

    def ground(self, pose: Pose) -> Ground:
        """Return the states of the cells of the square around the robot."""
        cells, corner = self.grid.log_odds()
        cell = self.grid.config.cell
        low = np.floor((pose[:2] - self._half - corner) / cell).astype(int)
        high = np.ceil((pose[:2] + self._half - corner) / cell).astype(int)
        low, high = np.maximum(low, 0), np.maximum(high, 0)
        part = cells[low[1] : high[1], low[0] : high[0]]
        return Ground(states_of(part), corner + (low - 1) * cell, cell)

    def layer(self, frame: Pose) -> OccupancyGridLayer:
        """Return the map as a layer, given the pose of the odometry's frame in the map's."""
        from albot_core.geometry.poses import compose

        layer = self.grid.layer()
        return OccupancyGridLayer(
            origin=compose(frame, layer.origin),
            resolution=layer.resolution,
            occupancy=layer.occupancy,
        )


@kernel(arrays=True)
def states_of(
    belief: Float32[np.ndarray, "rows columns"],
) -> Int8[np.ndarray, "rows+2 columns+2"]:
    """Return the states of cells, with a border of unknown ones.

    An unknown cell among five free ones is free: beams diverge, and leave out some cells far away.
    """
    rows, columns = belief.shape
    states = np.zeros((rows + 2, columns + 2), np.int8)
    for i in range(rows):
        for j in range(columns):
            if belief[i, j] > 0.0:
                states[i + 1, j + 1] = WALL
            elif belief[i, j] < 0.0:
                states[i + 1, j + 1] = FREE
    filled = states.copy()
    for i in range(1, rows + 1):
        for j in range(1, columns + 1):
            if states[i, j] == UNKNOWN:
                count = 0
                for a in range(i - 1, i + 2):
                    for b in range(j - 1, j + 2):
                        count += states[a, b] == FREE
                if count >= 5:
                    filled[i, j] = FREE
    filled[0, :] = filled[-1, :] = UNKNOWN
    filled[:, 0] = filled[:, -1] = UNKNOWN
    return filled
