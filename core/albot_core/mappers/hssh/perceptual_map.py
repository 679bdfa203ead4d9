"""The local perceptual map: an occupancy grid that scrolls with the robot (section 4 there)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int8

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.gateways import FREE, WALL, Ground
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
        """Enter a scan at the robot's pose."""
        self.grid.integrate(pose, scan)

    def scroll(self, pose: Pose) -> None:
        """Forget the tiles that do not touch the square around the robot."""
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

    def ground(self, pose: Pose, island: float) -> Ground:
        """Return the states of the cells of the square around the robot.

        Args:
            pose: The robot's pose.
            island: Largest extent of what stands alone on free ground and counts as free (m).
        """
        cells, corner = self.grid.log_odds()
        cell = self.grid.config.cell
        low = np.floor((pose[:2] - self._half - corner) / cell).astype(int)
        high = np.ceil((pose[:2] + self._half - corner) / cell).astype(int)
        low, high = np.maximum(low, 0), np.maximum(high, 0)
        part = cells[low[1] : high[1], low[0] : high[0]]
        return Ground(states_of(part, int(island / cell)), corner + (low - 1) * cell, cell)

    def layer(self, frame: Pose) -> OccupancyGridLayer:
        """Return the map as a layer, given the pose of the odometry's frame in the map's."""
        layer = self.grid.layer()
        return OccupancyGridLayer(
            origin=compose(frame, layer.origin),
            resolution=layer.resolution,
            occupancy=layer.occupancy,
        )


@kernel(arrays=True)
def states_of(
    belief: Float32[np.ndarray, "rows columns"], island: int
) -> Int8[np.ndarray, "rows+2 columns+2"]:
    """Return the states of cells, with a border of unknown ones.

    Args:
        belief: Log odds of the cells, 0 if unknown (rows, columns).
        island: Largest height and width of what stands alone on free ground and counts as free
            (cells): furniture, and cells far away that the diverging beams left out.
    """
    rows, columns = belief.shape
    states = np.zeros((rows + 2, columns + 2), np.int8)
    for i in range(rows):
        for j in range(columns):
            if belief[i, j] > 0.0:
                states[i + 1, j + 1] = WALL
            elif belief[i, j] < 0.0:
                states[i + 1, j + 1] = FREE
    stack = np.empty((states.size, 2), np.int32)
    is_seen = states == FREE
    _gather(states, is_seen, stack, 0, 0)  # What hangs together with the border.
    for i in range(rows + 2):
        for j in range(columns + 2):
            if not is_seen[i, j]:
                count, height, width = _gather(states, is_seen, stack, i, j)
                if height <= island and width <= island:
                    for k in range(count):
                        states[stack[k, 0], stack[k, 1]] = FREE
    return states


@kernel()
def _gather(
    states: np.ndarray, is_seen: np.ndarray, stack: np.ndarray, row: int, column: int
) -> tuple[int, int, int]:
    """Gather the cells that hang together with one and are not free.

    Returns:
        Their number on the stack, and the height and width of the box around them (cells).
    """
    rows, columns = states.shape
    stack[0, 0], stack[0, 1] = row, column
    is_seen[row, column] = True
    low_i, high_i, low_j, high_j = row, row, column, column
    done, count = 0, 1
    while done < count:
        i, j = stack[done, 0], stack[done, 1]
        done += 1
        low_i, high_i = min(low_i, i), max(high_i, i)
        low_j, high_j = min(low_j, j), max(high_j, j)
        for a in range(max(i - 1, 0), min(i + 2, rows)):
            for b in range(max(j - 1, 0), min(j + 2, columns)):
                if not is_seen[a, b]:
                    is_seen[a, b] = True
                    stack[count, 0], stack[count, 1] = a, b
                    count += 1
    return count, high_i - low_i + 1, high_j - low_j + 1
