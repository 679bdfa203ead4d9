"""Plan routes for a robot through a world: tours for worlds that come without any."""

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
"""Distance (m) that routes keep between the robot's centre and walls, as in the catalogue."""

_Stops = Float64[np.ndarray, "stops 2"]
_Waypoints = Float64[np.ndarray, "waypoints 2"]

_CELL = 0.1
"""Distance between neighbouring lattice points (m)."""
_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))


class Routes:
    """Short routes through a world that keep a distance from its walls.

    A shortest path over a lattice of points 0.1 m apart is straightened: each waypoint is the
    last lattice point on the path in a straight free line from the waypoint before.

    Args:
        world: The world; its movables are ignored.
        clearance: Distance of the robot's centre from every wall (m).
    """

    def __init__(self, world: World, clearance: float = CLEARANCE) -> None:
        self._world = world
        self._clearance = clearance
        self._floor = FreeSpace(world.walls, clearance).region_at(world.starts[0, :2])
        shapely.prepare(self._floor)

    def through(self, stops: _Stops) -> _Waypoints:
        """Return the waypoints (m) of a short route through the stops in order, stops included.

        Raises:
            InputError: There are fewer than two stops, or one is unreachable or too near a wall.
        """
        if len(stops) < 2:
            raise InputError(self._world.source, "two stops or more", str(len(stops)))
        for x, y in stops:
            if not self._floor.covers(shapely.Point(x, y)):
                raise InputError(
                    self._world.source,
                    f"stops {self._clearance} m from walls and reachable from the first start",
                    f"({x:g}, {y:g})",
                )
        legs = [self._straightened(self._way(*leg)) for leg in pairwise(stops)]
        return np.concatenate([stops[:1], *(leg[1:] for leg in legs)])

    def through_rooms(self, names: list[str]) -> _Waypoints:
        """Return the waypoints (m) of a route from room to room.

        The stop in each room is the centre of its largest disc of free floor.

        Raises:
            InputError: There is no such room, or the robot cannot enter it.
        """
        return self.through(np.array([self._middle(name) for name in names]))

    def _middle(self, name: str) -> tuple[float, float]:
        """Return the centre of the largest disc of free floor in a room (m)."""
        for room in self._world.rooms:
            if room.name == name:
                floor = self._floor.intersection(shapely.Polygon(room.boundary))
                if floor.area == 0.0:
                    raise InputError(self._world.source, "a room with free space", repr(name))
                disc = shapely.maximum_inscribed_circle(floor, tolerance=0.01)
                return disc.coords[0][0], disc.coords[0][1]
        raise InputError(self._world.source, "a room of this world", repr(name))

    def _way(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the points of a shortest path over the lattice, with `start` and `end` added."""
        first, last = (int(np.hypot(*(self._lattice - at).T).argmin()) for at in (start, end))
        _, before = dijkstra(self._graph, directed=False, indices=first, return_predecessors=True)
        way = [last]
        while way[-1] != first:
            way.append(int(before[way[-1]]))
            if way[-1] < 0:
                raise InputError(self._world.source, f"a path to {end}", "none")
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
        """The free points of the lattice, (n, 2) (m)."""
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
        """The graph that joins each free lattice point to its free neighbours."""
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
