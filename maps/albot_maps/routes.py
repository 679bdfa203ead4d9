"""Plan routes for a robot through a world: tours for worlds that come without any."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from jaxtyping import Bool, Float64
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from albot_core.errors import InputError
from albot_maps.freespace import FreeSpace
from albot_maps.world import World

SPARE = 0.1
"""Distance (m) that routes keep between the robot's body and walls, as in the catalogue."""

_Stops = Float64[np.ndarray, "stops 2"]
_Waypoints = Float64[np.ndarray, "waypoints 2"]

_CELLS = (0.1, 0.05, 0.025)
"""Distances between neighbouring lattice points (m). The coarsest lattice that has a path is taken:
in passages narrower than its cells a lattice may have no points."""
_STEPS = ((1, 0), (0, 1), (1, 1), (1, -1))


class Routes:
    """Short routes through a world that keep a distance from its walls.

    A shortest path over a lattice of points 0.1 m apart, or less where passages are narrow, is
    straightened: each waypoint is the last lattice point on the path in a straight free line from
    the waypoint before.

    Args:
        world: The world; its movables are ignored.
        spare: Distance of the robot's body from every wall (m).
    """

    def __init__(self, world: World, spare: float = SPARE) -> None:
        self._world = world
        self._clearance = world.robot_radius + spare
        self._floor = FreeSpace(world.walls, self._clearance).region_at(world.starts[0, :2])
        shapely.prepare(self._floor)
        self._lattices: dict[float, _Lattice] = {}

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
                    f"stops {self._clearance:g} m from walls and reachable from the first start",
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
        """Return the points of a shortest path over a lattice, with `start` and `end` added.

        The coarsest lattice that has a path is taken.
        """
        for cell in _CELLS:
            way = self._lattice(cell).way(start, end)
            if way is not None:
                return np.concatenate([[start], way, [end]])
        raise InputError(self._world.source, f"a path to {end}", "none")

    def _straightened(self, way: np.ndarray) -> _Waypoints:
        kept = [0]
        for index in range(1, len(way) - 1):
            line = shapely.LineString(way[[kept[-1], index + 1]])
            if not self._floor.covers(line):
                kept.append(index)
        return way[[*kept, len(way) - 1]]

    def _lattice(self, cell: float) -> _Lattice:
        """The free points of a lattice; it is made once."""
        if cell not in self._lattices:
            x_min, y_min, x_max, y_max = self._world.bounds
            x, y = np.meshgrid(
                np.arange(x_min, x_max, cell), np.arange(y_min, y_max, cell), indexing="ij"
            )
            free = np.asarray(shapely.contains_xy(self._floor, x, y))
            points = np.stack((x[free], y[free]), axis=-1)
            self._lattices[cell] = _Lattice(points=points, graph=_join(free))
        return self._lattices[cell]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lattice:
    """Points of the floor, each joined to its neighbours."""

    points: Float64[np.ndarray, "points 2"]
    """Where they are (m)."""
    graph: csr_matrix
    """Distances from neighbour to neighbour, in cells."""

    def way(self, start: np.ndarray, end: np.ndarray) -> Float64[np.ndarray, "way 2"] | None:
        """The points of a shortest path from near a place to near another (m); None without."""
        first, last = (int(np.hypot(*(self.points - at).T).argmin()) for at in (start, end))
        _, before = dijkstra(self.graph, directed=False, indices=first, return_predecessors=True)
        way = [last]
        while way[-1] != first:
            way.append(int(before[way[-1]]))
            if way[-1] < 0:
                return None
        return np.asarray(self.points[way[::-1]])


def _join(free: Bool[np.ndarray, "columns rows"]) -> csr_matrix:
    """The graph that joins each free lattice point to its free neighbours."""
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
