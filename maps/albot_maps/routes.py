"""Ways for a robot over a world's floor: the tours of worlds that come without any."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from jaxtyping import Float64
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from albot_core.errors import InputError
from albot_maps.freespace import FreeSpace
from albot_maps.world import World

CLEARANCE = 0.35
"""How far routes keep the robot's middle from the walls, as the catalogue's tours do (m)."""

_Stops = Float64[np.ndarray, "stops 2"]
_Waypoints = Float64[np.ndarray, "waypoints 2"]

_CELL = 0.1
"""Distance of neighbouring lattice points (m)."""
_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))


class Routes:
    """Short ways over the floor of a world, at a distance from its walls.

    A shortest way over a lattice of points 0.1 m apart is pulled straight: each waypoint is
    the last one that can be reached in a straight line from the one before.

    Args:
        world: The world; what moves in it is passed over.
        clearance: How far the robot's middle keeps from every wall (m).
    """

    def __init__(self, world: World, clearance: float = CLEARANCE) -> None:
        self._world = world
        self._clearance = clearance
        self._floor = FreeSpace(world.walls, clearance).region_at(world.starts[0, :2])
        shapely.prepare(self._floor)

    def through(self, stops: _Stops) -> _Waypoints:
        """The waypoints (m) of a short way through the stops in turn, the stops included.

        Raises:
            InputError: Fewer than two stops, or one that is too near to a wall or out of reach.
        """
        if len(stops) < 2:
            raise InputError(self._world.source, "two stops or more", str(len(stops)))
        for x, y in stops:
            if not self._floor.covers(shapely.Point(x, y)):
                raise InputError(
                    self._world.source,
                    f"stops {self._clearance} m from walls that the first start reaches",
                    f"({x:g}, {y:g})",
                )
        legs = [self._straightened(self._way(*leg)) for leg in pairwise(stops)]
        return np.concatenate([stops[:1], *(leg[1:] for leg in legs)])

    def through_rooms(self, names: list[str]) -> _Waypoints:
        """A way from room to room, to where each has most space.

        Raises:
            InputError: There is no such room, or the robot does not get in.
        """
        return self.through(np.array([self._middle(name) for name in names]))

    def _middle(self, name: str) -> tuple[float, float]:
        """The middle of the largest disc of free floor in a room (m)."""
        for room in self._world.rooms:
            if room.name == name:
                floor = self._floor.intersection(shapely.Polygon(room.boundary))
                if floor.area == 0.0:
                    raise InputError(self._world.source, "a room with space", repr(name))
                disc = shapely.maximum_inscribed_circle(floor, tolerance=0.01)
                return disc.coords[0][0], disc.coords[0][1]
        raise InputError(self._world.source, "a room of this world", repr(name))

    def _way(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The points of a shortest way over the lattice, the ends put before and behind."""
        first, last = (int(np.hypot(*(self._lattice - at).T).argmin()) for at in (start, end))
        _, before = dijkstra(self._graph, directed=False, indices=first, return_predecessors=True)
        way = [last]
        while way[-1] != first:
            way.append(int(before[way[-1]]))
            if way[-1] < 0:
                raise InputError(self._world.source, f"a way to {end}", "none")
        return np.concatenate([[start], self._lattice[way[::-1]], [end]])

    def _straightened(self, way: np.ndarray) -> _Waypoints:
        kept = [0]
        for index in range(1, len(way) - 1):
            line = shapely.LineString(way[[kept[-1], index + 1]])
            if not self._floor.covers(line):
                kept.append(index)
        return way[[*kept, len(way) - 1]]

    @cached_property
    def _lattice(self) -> np.ndarray:
        """(n, 2): the free points of the lattice (m)."""
        x, y = self._axes
        return np.stack((x[self._free], y[self._free]), axis=-1)

    @cached_property
    def _axes(self) -> tuple[np.ndarray, np.ndarray]:
        x_min, y_min, x_max, y_max = self._world.bounds
        x, y = np.meshgrid(
            np.arange(x_min, x_max, _CELL), np.arange(y_min, y_max, _CELL), indexing="ij"
        )
        return x, y

    @cached_property
    def _free(self) -> np.ndarray:
        return np.asarray(shapely.contains_xy(self._floor, *self._axes))

    @cached_property
    def _graph(self) -> csr_matrix:
        """The lattice's free points, each joined to its free neighbours."""
        free = self._free
        index = np.full(free.shape, -1)
        index[free] = np.arange(np.count_nonzero(free))
        ends, lengths = [], []
        for dx, dy in _STEPS:
            here = index[: -dx or None, max(0, -dy) : -dy if dy > 0 else None]
            there = index[dx:, max(0, dy) : dy if dy < 0 else None]
            both = (here >= 0) & (there >= 0)
            ends.append((here[both], there[both]))
            lengths.append(np.full(np.count_nonzero(both), np.hypot(dx, dy)))
        rows, columns = (np.concatenate(side) for side in zip(*ends, strict=True))
        count = np.count_nonzero(free)
        return coo_matrix((np.concatenate(lengths), (rows, columns)), shape=(count, count)).tocsr()
