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
from albot_core.mappers.slam.tiles import (
    NONE,
    TILE,
    PoolArrays,
    release_tiles,
    tiles_around,
)
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
        grid, cell = self.grid, self.grid.config.cell
        low = np.floor((pose[:2] - self._half) / cell).astype(np.int64)
        high = np.ceil((pose[:2] + self._half) / cell).astype(np.int64)
        belief = _belief_within(grid.pool.arrays, grid.index, grid.corner, low, high)
        return Ground(states_of(belief, int(island / cell)), (low - 1) * cell, cell)

    def layer(self, frame: Pose) -> OccupancyGridLayer:
        """Return the map as a layer, given the pose of the odometry's frame in the map's."""
        layer = self.grid.layer()
        return OccupancyGridLayer(
            origin=compose(frame, layer.origin),
            resolution=layer.resolution,
            occupancy=layer.occupancy,
        )


@kernel(arrays=True)
def _belief_within(
    pool: PoolArrays, index: np.ndarray, corner: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Return the log odds of the cells of a rectangle, 0 where nothing is known (rows, columns).

    Args:
        pool: The tiles.
        index: The tile at each place (rows, columns).
        corner: Row and column of the index's first tile.
        low: Column and row of the first cell.
        high: The ends of the columns and rows.
    """
    rows, columns = high[1] - low[1], high[0] - low[0]
    belief = np.zeros((rows, columns), np.float32)
    for tile_row in range(index.shape[0]):
        top = (corner[0] + tile_row) * TILE - low[1]
        for tile_column in range(index.shape[1]):
            tile = index[tile_row, tile_column]
            left = (corner[1] + tile_column) * TILE - low[0]
            first, last = max(left, 0), min(left + TILE, columns)
            if tile == NONE or first >= last:
                continue
            for i in range(max(top, 0), min(top + TILE, rows)):
                here, known = belief[i, first:last], pool.cells[tile, i - top, first - left :]
                for j in range(len(here)):
                    here[j] = known[j]
    return belief


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
        here, line = states[i + 1, 1:-1], belief[i]
        for j in range(columns):
            here[j] = WALL * (line[j] > 0.0) + FREE * (line[j] < 0.0)
    _free_islands(states, island)
    return states


@kernel(arrays=True)
def _free_islands(states: np.ndarray, island: int) -> None:
    """Make the small pieces free that hang together, are not free and do not touch the border.

    The pieces are found by the runs of cells in each row (union-find; A. Rosenfeld and J. Pfaltz,
    Sequential operations in digital picture processing, JACM 1966). Cells hang together by their
    corners, too.

    Args:
        states: State of each cell, changed in place.
        island: Largest height and width (cells).
    """
    rows, columns = states.shape
    most = rows * (columns // 2 + 1)
    runs = np.empty((most, 3), np.int32)  # The row, the first column, and the end.
    boxes = np.empty((most, 4), np.int32)  # Of the run's piece: the first and last row and column.
    root = np.empty(most, np.int32)
    count = above = begun = 0  # `above`: the first run of the row above that may touch.
    for i in range(rows):
        above, begun = begun, count
        last, j = begun, 0
        while j < columns:
            if states[i, j] == FREE:
                j += 1
                continue
            start = j
            while j < columns and states[i, j] != FREE:
                j += 1
            runs[count, 0], runs[count, 1], runs[count, 2] = i, start, j
            boxes[count, 0], boxes[count, 1] = i, i
            boxes[count, 2], boxes[count, 3] = start, j - 1
            root[count] = count
            while above < last and runs[above, 2] < start:
                above += 1
            k = above
            while k < last and runs[k, 1] <= j:
                _join(root, boxes, k, count)
                k += 1
            count += 1
    for n in range(count):
        k = _root(root, n)
        first, last, left, right = boxes[k]
        if k != 0 and last - first < island and right - left < island:
            states[runs[n, 0], runs[n, 1] : runs[n, 2]] = FREE


@kernel()
def _root(root: np.ndarray, run: int) -> int:
    """Return the run that stands for a run's piece."""
    while root[run] != run:
        root[run] = root[root[run]]
        run = root[run]
    return run


@kernel()
def _join(root: np.ndarray, boxes: np.ndarray, one: int, other: int) -> None:
    """Join the pieces of two runs; the earlier run stands for both."""
    one, other = _root(root, one), _root(root, other)
    first, second = min(one, other), max(one, other)
    root[second] = first
    boxes[first, 0] = min(boxes[first, 0], boxes[second, 0])
    boxes[first, 1] = max(boxes[first, 1], boxes[second, 1])
    boxes[first, 2] = min(boxes[first, 2], boxes[second, 2])
    boxes[first, 3] = max(boxes[first, 3], boxes[second, 3])
