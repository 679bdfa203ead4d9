"""The shortest way for a robot through a world, by brute force: the oracle for its lengths."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from albot_maps import World
from albot_maps.freespace import wall_lines

# Every direction to a cell at most three away: no way is drawn more than 1.4 % too long.
STEPS = ((1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (3, 1), (1, 3), (3, 2), (2, 3))


class Lattice:
    """Points 0.1 m apart that a disc of a given radius can stand on, joined to near ones."""

    CELL = 0.1

    def __init__(self, world: World, radius: float) -> None:
        x_min, y_min, x_max, y_max = world.bounds
        self.corner = np.array([x_min, y_min])
        x, y = np.meshgrid(
            np.arange(x_min, x_max, self.CELL), np.arange(y_min, y_max, self.CELL), indexing="ij"
        )
        walls = wall_lines(world.walls)
        shapely.prepare(walls)
        self.free = shapely.distance(shapely.points(x, y), walls) >= radius
        self.graph = self._joined()

    def _joined(self):
        index = np.arange(self.free.size).reshape(self.free.shape)
        rows, columns, lengths = [], [], []
        for dx, dy in {(dx, sign * dy) for dx, dy in STEPS for sign in (1, -1)}:
            here = (slice(0, -dx or None), slice(max(0, -dy), -dy if dy > 0 else None))
            there = (slice(dx, None), slice(max(0, dy), dy if dy < 0 else None))
            both = self.free[here] & self.free[there]
            rows.append(index[here][both])
            columns.append(index[there][both])
            lengths.append(np.full(np.count_nonzero(both), np.hypot(dx, dy) * self.CELL))
        cells = (np.concatenate(rows), np.concatenate(columns))
        shape = (self.free.size, self.free.size)
        return coo_matrix((np.concatenate(lengths), cells), shape=shape).tocsr()

    def node(self, point: Sequence[float]) -> int:
        column, row = np.round((np.asarray(point) - self.corner) / self.CELL).astype(int)
        assert self.free[column, row], f"{point} is not free"
        return int(np.ravel_multi_index((column, row), self.free.shape))

    def way(self, points: Sequence[Sequence[float]]) -> float:
        """Length (m) of the shortest way through the points in turn; infinity if there is none."""
        nodes = [self.node(point) for point in points]
        legs = dijkstra(self.graph, directed=False, indices=nodes[:-1])
        return float(sum(legs[leg, node] for leg, node in enumerate(nodes[1:])))


@pytest.fixture(scope="session")
def lattice() -> Callable[[World, float], Lattice]:
    """Makes a world's lattice, once for each world and radius."""
    made: dict[tuple[str, float], Lattice] = {}

    def of(world: World, radius: float) -> Lattice:
        key = world.source, radius
        if key not in made:
            made[key] = Lattice(world, radius)
        return made[key]

    return of
