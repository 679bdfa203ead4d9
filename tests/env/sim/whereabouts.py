"""Robots anywhere in and about a building, and the cells of an index of walls that they are in."""

from __future__ import annotations

import numpy as np

from albot_env.sim.wall_index import Locator, WallIndex


def poses_about(
    walls: np.ndarray, margin: float, count: int, rng: np.random.Generator
) -> np.ndarray:
    """So many poses by chance, up to a margin (m) beyond the walls."""
    low = walls.reshape(-1, 2).min(axis=0) - margin
    high = walls.reshape(-1, 2).max(axis=0) + margin
    return np.column_stack((rng.uniform(low, high, (count, 2)), rng.uniform(-4, 4, count)))


def cells_of(index: WallIndex, poses: np.ndarray) -> np.ndarray:
    """The cells of the first building's poses, whose walls are listed now."""
    count = len(poses)
    cells, unused = np.empty(count, np.int64), np.empty(count, np.int64)
    nothing = WallIndex(0.0, (0.0, 0.0))
    rows, building = np.arange(count), np.zeros(count, np.int64)
    Locator(index, nothing).locate(rows, building, poses, cells, unused)
    return cells
