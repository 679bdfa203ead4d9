"""The mappers' maps as arrays that compiled code takes, for the parts that show them.

A mapper gives its map as layers (`albot_core.maps.layers`). They are read into the arrays again
only when the map has changed. So a map is observed as the mapper believes it now, corrections
included.
"""

from __future__ import annotations

import math
from threading import Lock
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.geometry.types import Points
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import MapperSpec, RecognitionBatch
from albot_core.maps.layers import (
    MapSnapshot,
    OccupancyGridLayer,
    PlaceGraph,
    TrajectoryLayer,
)
from albot_env.tasks.core.coverage import with_coverage, words_of
from albot_env.tasks.core.coverage_kernels import CoverageGrid
from albot_env.tasks.core.row_arrays import Arrays

CELL = 0.25
"""Side of the cells to which occupancy grids are thinned (m)."""
IS_OCCUPIED = 0.5
"""A cell of an occupancy grid that is occupied with more than this probability is a wall; with
less, free ground."""


@runtime_checkable
class MapSource(Protocol):
    """What is needed of the robots' mappers: a `MapperBatch` is one."""

    @property
    def spec(self) -> MapperSpec:
        """The mappers' spec."""

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.map_version` of each."""

    def snapshot(self, row: int) -> MapSnapshot:
        """Return the map of a row."""


class RaggedRows(NamedTuple):
    """Rows of numbers of several robots, who may have any number of them."""

    counts: np.ndarray
    """(robots,) int64: number of rows of each robot."""
    rows: np.ndarray
    """(robots, most, columns): the rows; those from a robot's count on mean nothing."""


class MapArrays(NamedTuple):
    """What the mappers remember (map frames, m, rad), for compiled code; one row per robot."""

    walls: RaggedRows
    """Columns x1, y1, x2, y2 (float64): the line segments; of an occupancy grid, the centres of
    occupied cells, as segments of no length."""
    free: CoverageGrid
    """Ground that is free in the mapper's occupancy grid; without cells if it has none."""
    trail: RaggedRows
    """Columns x, y (float64): the mapper's trajectory, or else where the robot believed to be, from
    the oldest point to the newest, `TrailConfig.spacing` metres apart."""
    exits: RaggedRows
    """Columns x1, y1, x2, y2 (float64): the lines across the doorways between places."""
    places: RaggedRows
    """Columns x, y, visits (float64): the places, in the order of the place graph; 0 visits if the
    mapper does not count them."""
    current: np.ndarray
    """(robots,) int64: index in `places` of the present place; -1 for none."""
    home: np.ndarray
    """(robots,) int64: index in `places` of the place where the robot started; -1 for none."""
    ends: RaggedRows
    """Columns source, target (int64): the places that each connection joins, by index."""
    motions: RaggedRows
    """Columns x, y, heading (float64): the pose of the target's frame in the source's frame, of
    each connection."""
    matches: RaggedRows
    """Columns of `PlaceMatches` (float64): the best matches of the present place."""
    readings: np.ndarray
    """(robots,) int64: number of the latest reading of each mapper, counted from 0."""


class TrailConfig(NamedTuple):
    """Which of the believed positions make a trail."""

    spacing: float
    """Distance from one to the next (m)."""
    most: int
    """Number of positions that are remembered, the latest."""


class MapReader:
    """Reads the maps of robots into `MapArrays` when they have changed.

    Rows are independent: threads may update disjoint rows at the same time.

    Args:
        robots: Number of robots.
        mappers: Their mappers; None on robots without one, which remember only their own trail.
        trail: Which positions make a trail.
        reads_maps: Whether the mappers' maps are needed, besides the robots' own trails.
        matches: Number of matches of the present place that are needed.
    """

    def __init__(
        self,
        robots: int,
        mappers: MapSource | None,
        trail: TrailConfig,
        *,
        reads_maps: bool,
        matches: int = 0,
    ) -> None:
        self._mappers, self._trail = mappers if reads_maps or matches else None, trail
        self._reads_maps, self._matches = reads_maps, matches
        layers = () if mappers is None else mappers.spec.layers
        self._has_grid = OccupancyGridLayer.kind in layers
        self._has_trajectory = TrajectoryLayer.kind in layers
        self._versions = np.full(robots, -1)
        self._graphs: list[PlaceGraph | None] = [None] * robots
        self._growing = Lock()
        self.arrays = MapArrays(
            walls=_no_rows(robots, 4),
            free=CoverageGrid(
                grids=np.zeros((robots, 0), np.uint64),
                sides=np.zeros(robots, np.int64),
                centres=np.zeros((robots, 2)),
                cell=CELL,
            ),
            trail=_no_rows(robots, 2, trail.most),
            exits=_no_rows(robots, 4),
            places=_no_rows(robots, 3),
            current=np.full(robots, -1),
            home=np.full(robots, -1),
            ends=_no_rows(robots, 2, kind=np.int64),
            motions=_no_rows(robots, 3),
            matches=_no_rows(robots, 6),
            readings=np.full(robots, -1),
        )
        """The maps; a new tuple whenever one of them needs more room."""

    def begin(self, row: int, extent: float) -> None:
        """Forget the map of a robot, which can reach `extent` (m) from the map's origin."""
        self._versions[row], self._graphs[row] = -1, None
        arrays = self.arrays
        for ragged in arrays:
            if isinstance(ragged, RaggedRows):
                ragged.counts[row] = 0
        arrays.current[row] = arrays.home[row] = arrays.readings[row] = -1
        if self._has_grid:
            side = 8 * math.ceil(extent / CELL / 4)
            self.arrays = arrays._replace(free=with_coverage(arrays.free, row, side, (0.0, 0.0)))

    def update(
        self,
        rows: Int64[np.ndarray, "some"],
        beliefs: Float64[np.ndarray, "robots 3"],
        arrived: int | Int64[np.ndarray, "some"] = 1,
    ) -> None:
        """Read the maps of some robots that have changed, after the mappers' update.

        Args:
            rows: The robots.
            beliefs: Believed poses of all robots (map frames).
            arrived: Number of readings that have arrived at each of them.
        """
        self.arrays.readings[rows] += arrived
        if not self._has_trajectory:
            self._leave_trail(rows, beliefs)
        if self._mappers is None:
            return
        versions = self._mappers.map_versions
        changed = rows[versions[rows] != self._versions[rows]]
        self._versions[changed] = versions[changed]
        for row in changed.tolist():
            if self._reads_maps:
                self._read(row, self._mappers.snapshot(row))
            if self._matches:
                assert isinstance(self._mappers, RecognitionBatch)
                self._put("matches", row, self._mappers.place_matches(row, self._matches))

    def _leave_trail(
        self, rows: Int64[np.ndarray, "some"], beliefs: Float64[np.ndarray, "robots 3"]
    ) -> None:
        """Add the believed positions of those who have gone on to their trails."""
        counts, points = self.arrays.trail
        last = points[rows, np.maximum(counts[rows] - 1, 0)]
        gone = np.hypot(*(beliefs[rows, :2] - last).T) >= self._trail.spacing
        for row in rows[gone | (counts[rows] == 0)].tolist():
            if counts[row] == self._trail.most:
                points[row, :-1] = points[row, 1:]
                counts[row] -= 1
            points[row, counts[row]] = beliefs[row, :2]
            counts[row] += 1

    def _read(self, row: int, snapshot: MapSnapshot) -> None:
        """Read a robot's map."""
        grid = snapshot.layer(OccupancyGridLayer)
        if grid is None:
            self._put("walls", row, snapshot.segments)
        else:
            occupied, free = thinned(grid)
            self._put("walls", row, np.concatenate((occupied, occupied), axis=1))
            mark_points(self.arrays.free, row, free)
        way = snapshot.layer(TrajectoryLayer)
        if way is not None:
            points = np.ascontiguousarray(way.poses[:, :2], np.float64)
            self._put("trail", row, thinned_trail(points, *self._trail))
        graph = snapshot.layer(PlaceGraph)
        if graph is not None and graph is not self._graphs[row]:
            self._graphs[row] = graph
            self._read_graph(row, graph)

    def _read_graph(self, row: int, graph: PlaceGraph) -> None:
        """Read a robot's place graph."""
        number = {node.id: k for k, node in enumerate(graph.nodes)}
        middles = np.reshape([node.middle for node in graph.nodes], (-1, 2))
        visits = [[node.visits or 0] for node in graph.nodes]
        columns = transform_points(graph.frame, middles), np.reshape(visits, (-1, 1))
        ends = [(number[edge.source], number[edge.target]) for edge in graph.edges]
        self._put("places", row, np.concatenate(columns, axis=1))
        self._put("ends", row, np.reshape(ends, (-1, 2)).astype(np.int64))
        self._put("motions", row, np.reshape([edge.motion for edge in graph.edges], (-1, 3)))
        self._put("exits", row, transform_segments(graph.frame, graph.doorways()))
        for name in ("current", "home"):
            place = getattr(graph, name)
            getattr(self.arrays, name)[row] = -1 if place is None else number[place]

    def _put(self, name: str, row: int, values: np.ndarray) -> None:
        """Replace a robot's rows of an array; a larger one is made if needed."""
        with self._growing:  # Other threads must not write into an array while it is copied.
            ragged: RaggedRows = getattr(self.arrays, name)
            most = ragged.rows.shape[1]
            if len(values) > most:
                more = ((0, 0), (0, max(len(values), 2 * most) - most), (0, 0))
                ragged = ragged._replace(rows=np.pad(ragged.rows, more))
                self.arrays = self.arrays._replace(**{name: ragged})  # type: ignore[arg-type]
            ragged.rows[row, : len(values)] = values
            ragged.counts[row] = len(values)

    def trail(self, row: int) -> Points:
        """Return the trail of a robot (a copy): what is remembered here and not by its mapper."""
        counts, points = self.arrays.trail
        return np.asarray(points[row, : counts[row]].copy())

    def set_trail(self, row: int, trail: Points, readings: int) -> None:
        """Give a robot, after `begin`, a trail and a number of readings that its mapper has had."""
        self._put("trail", row, trail)
        self.arrays.readings[row] = readings - 1

    def state(self, row: int) -> Arrays:
        """Return what a robot remembers that does not follow from its mapper's state (copies)."""
        counts, matches = self.arrays.matches
        return {
            "map.trail": self.trail(row),
            "map.matches": matches[row, : counts[row]].copy(),
            "map.readings": np.array(self.arrays.readings[row]),
        }

    def set_state(self, row: int, state: Arrays) -> None:
        """Give a robot what `state` returned, after `begin` and after its mapper got its own."""
        self.set_trail(row, state["map.trail"], int(state["map.readings"]) + 1)
        self._put("matches", row, state["map.matches"])
        if self._mappers is not None:
            # The matches are those of when the map changed last.
            self._versions[row] = self._mappers.map_versions[row]
            if self._reads_maps:
                self._read(row, self._mappers.snapshot(row))


def _no_rows(robots: int, columns: int, most: int = 0, kind: Any = np.float64) -> RaggedRows:
    return RaggedRows(np.zeros(robots, np.int64), np.zeros((robots, most, columns), kind))


def thinned(grid: OccupancyGridLayer) -> tuple[Points, Points]:
    """Return the centres of a grid's occupied and of its free blocks (m, map frame).

    A block is a square of cells with a side of at most `CELL`. It is occupied if one of its cells
    is, and free if it is not occupied and at least half of its cells are free.
    """
    per_block = max(1, int(CELL / grid.resolution + 1e-9))
    rows, columns = (-(-length // per_block) for length in grid.occupancy.shape)
    cells = np.full((rows * per_block, columns * per_block), np.nan, np.float32)
    cells[: grid.occupancy.shape[0], : grid.occupancy.shape[1]] = grid.occupancy
    blocks = cells.reshape(rows, per_block, columns, per_block).swapaxes(1, 2)
    with np.errstate(invalid="ignore"):
        occupied = (blocks > IS_OCCUPIED).any(axis=(2, 3))
        free = (blocks < IS_OCCUPIED).mean(axis=(2, 3)) >= 0.5
    side = per_block * grid.resolution
    occupied_centres, free_centres = (
        transform_points(grid.origin, (np.argwhere(which)[:, ::-1] + 0.5) * side)
        for which in (occupied, free & ~occupied)
    )
    return occupied_centres, free_centres


def mark_points(ground: CoverageGrid, row: int, points: Points) -> None:
    """Cover the cells of a robot's grid in which points (m) lie, and no others."""
    side = int(ground.sides[row])
    words = words_of(ground, row)
    words[:] = 0
    cells = np.floor((points - ground.centres[row]) / ground.cell + side / 2).astype(np.int64)
    x, y = cells[((cells >= 0) & (cells < side)).all(axis=1)].T
    bits = np.left_shift(np.uint64(1), ((y & 7) << 3 | x & 7).astype(np.uint64))
    np.bitwise_or.at(words, (y >> 3) * (side // 8) + (x >> 3), bits)


@kernel(arrays=True)
def thinned_trail(points: np.ndarray, spacing: float, most: int) -> np.ndarray:
    """Return the points (n, 2) of a trajectory that are `spacing` (m) from the next one taken.

    The newest is always taken; at most `most` are, in order of time.
    """
    taken = np.empty((most, 2))
    count = 0
    for k in range(points.shape[0] - 1, -1, -1):
        x, y = points[k, 0], points[k, 1]
        last = taken[most - count] if count else points[k]
        if count and length_of(x - last[0], y - last[1]) < spacing:
            continue
        if count == most:
            break
        count += 1
        taken[most - count, 0], taken[most - count, 1] = x, y
    return taken[most - count :]
