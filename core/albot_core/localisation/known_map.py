"""A saved map, as localisation uses it: walls, free ground, and likelihood fields.

It is made from the layers of any mapper's snapshot: from an occupancy grid as it is; from line
segments by drawing them. There the ground is free that can be seen, up to the first wall, from
known viewpoints or from ground that was seen from them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import UInt8
from scipy.ndimage import distance_transform_edt

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.localisation.config import LocaliserConfig
from albot_core.maps.layers import MapSnapshot, OccupancyGridLayer, TrajectoryLayer
from albot_core.matching.likelihood_field import FieldConfig, LikelihoodField

CELL = 0.05
"""Side of a cell of the ground (m)."""
UNKNOWN, FREE, WALL = 0, 1, 2
"""What a cell of the ground is."""
_OCCUPIED, _EMPTY = 0.6, 0.4
"""A grid's cell is a wall from the first probability on, and free up to the second."""
_BORDER = 1.0
"""Unknown ground around the map (m)."""
_SIGHT = 8.0
"""Distance within which ground seen from a viewpoint is free (m)."""
_RAYS = 360
"""Number of directions in which a viewpoint sees."""
_APART = 0.75
"""Viewpoints are this far apart (m)."""
_ROUNDS = 2
"""How often ground that is seen to be free becomes a viewpoint itself."""
FARTHEST = 1.0
"""Distances from walls are known up to this (m)."""
_BODY = 0.15
"""The robot's position is at least this far from each wall (m), which is less than its radius."""
BLOCK_BITS = 2
BLOCK = 1 << BLOCK_BITS
"""Cells of the coarse field along each side of a block whose poses are bounded together."""
_LARGEST = 200.0
"""Half the largest extent of a map (m): the field's limit."""


class Ground(NamedTuple):
    """The ground as cells, for compiled code."""

    kinds: np.ndarray
    """`UNKNOWN`, `FREE` or `WALL`, (rows, columns) uint8."""
    distances: np.ndarray
    """Distance from the nearest wall (cm, up to `FARTHEST`), (rows, columns) uint8."""
    corner: np.ndarray
    """x, y of the outer corner of the first cell (m), (2,)."""


class KnownMap:
    """A saved map. It never changes, so robots may share it.

    Args:
        snapshot: The map's layers.
        config: Resolution of the likelihood fields.
        viewpoints: Points from which the robot saw the walls (m, map frame). By default those of
            the snapshot: its trajectory, its places and their doorways.
        source: Name of the map in errors.

    Raises:
        InputError: The map has no walls, or is larger than any building.
    """

    def __init__(
        self,
        snapshot: MapSnapshot,
        config: LocaliserConfig,
        viewpoints: Points | None = None,
        source: object = "the saved map",
    ) -> None:
        self.snapshot = snapshot
        grid = snapshot.layer(OccupancyGridLayer)
        segments = segments_of(snapshot)
        if grid is not None and grid.occupancy.size:
            walls, ground = grid.centres(_OCCUPIED), _ground_of_grid(grid)
        else:
            seen_from = viewpoints_of(snapshot) if viewpoints is None else viewpoints
            walls = _sampled(segments)
            ground = _ground_of_walls(walls, segments, seen_from, source) if len(walls) else None
        if not len(walls) or ground is None:
            raise InputError(source, "a map with walls (a grid or line segments)", "none")
        self.walls: Points = walls
        """Points on the walls, at most a cell apart (m)."""
        self.ground = ground
        """The ground as cells."""
        self.field = _field_of(walls, config.field, source, walls)
        """The likelihood field of the walls, for matching."""
        low = ground.corner
        high = low + np.array(ground.kinds.shape)[::-1] * CELL
        reach = config.search_reach + 2 * BLOCK * config.coarse.cell
        around = np.array((low - reach, high + reach))
        self.coarse = _field_of(walls, config.coarse, source, around)
        """The likelihood field of the walls, for search; no pose's points leave it."""
        self.is_open = _open_cells(ground, self.coarse)
        """Cells of the coarse field in which the robot may stand, (side, side) bool."""
        self.blocks, self.is_open_block = _blocks_of(self.coarse, self.is_open)

    @property
    def open_area(self) -> float:
        """Area in which the robot may stand (m²)."""
        return float(self.is_open.sum()) * self.coarse.config.cell**2


def segments_of(snapshot: MapSnapshot) -> Segments:
    """Return the surfaces of a map: its line segments and those of its places (m, map frame)."""
    nodes = snapshot.place_graph.nodes
    parts = [transform_segments(node.pose, node.segments) for node in nodes if len(node.segments)]
    return np.concatenate([snapshot.segments, *parts])


def viewpoints_of(snapshot: MapSnapshot) -> Points:
    """Return the points from which a map's walls were seen: way, places, doorways (m)."""
    way = snapshot.layer(TrajectoryLayer)
    graph = snapshot.place_graph
    doorways = graph.doorways()
    parts = [
        np.empty((0, 2)) if way is None else way.poses[:, :2],
        np.reshape([node.pose[:2] for node in graph.nodes], (-1, 2)),
        np.reshape([node.middle for node in graph.nodes], (-1, 2)),
        0.5 * (doorways[:, :2] + doorways[:, 2:]),
    ]
    return np.concatenate(parts).astype(np.float64)


def _sampled(segments: Segments) -> Points:
    """Return points along line segments, at most half a cell apart (m), so that none is passed."""
    points = []
    for line in segments:
        count = max(2, math.ceil(math.dist(line[:2], line[2:]) / (0.5 * CELL)) + 1)
        along = np.linspace(0.0, 1.0, count)[:, None]
        points.append(line[:2] + along * (line[2:] - line[:2]))
    return np.concatenate(points) if points else np.empty((0, 2))


def _ground_of_grid(grid: OccupancyGridLayer) -> Ground | None:
    """Return the ground of an occupancy grid."""
    known = ~np.isnan(grid.occupancy)
    rows, columns = np.nonzero(known)
    if not len(rows):
        return None
    local = (np.stack((columns, rows), axis=-1) + 0.5) * grid.resolution
    cos, sin = math.cos(grid.origin[2]), math.sin(grid.origin[2])
    points = grid.origin[:2] + local @ np.array(((cos, sin), (-sin, cos)))
    occupancy = grid.occupancy[rows, columns]
    corner = points.min(axis=0) - _BORDER
    shape = np.ceil((points.max(axis=0) + _BORDER - corner) / CELL).astype(int)[::-1]
    # A cell of the grid may cover several cells of the ground.
    parts = max(1, math.ceil(grid.resolution / CELL))
    offsets = ((np.arange(parts) + 0.5) / parts - 0.5) * grid.resolution
    kinds = np.zeros(shape, np.uint8)
    for kind, chosen in ((FREE, occupancy <= _EMPTY), (WALL, occupancy >= _OCCUPIED)):
        for dx in offsets:
            for dy in offsets:
                where = ((points[chosen] + (dx, dy) - corner) / CELL).astype(int)
                kinds[where[:, 1], where[:, 0]] = kind
    return _with_distances(kinds, corner)


def _ground_of_walls(
    walls: Points, segments: Segments, viewpoints: Points, source: object
) -> Ground:
    """Return the ground of a map of line segments, seen from some viewpoints."""
    around = np.concatenate((walls, viewpoints))
    corner = around.min(axis=0) - _BORDER
    extent = around.max(axis=0) + _BORDER - corner
    if max(extent) > 2 * _LARGEST:
        expected = f"a map of at most {2 * _LARGEST:g} m"
        raise InputError(source, expected, f"{max(extent):.0f} m")
    shape = np.ceil(extent / CELL).astype(int)[::-1]
    kinds = np.zeros(shape, np.uint8)
    where = ((walls - corner) / CELL).astype(int)
    kinds[where[:, 1], where[:, 0]] = WALL
    eyes = viewpoints
    for _ in range(_ROUNDS):
        # One viewpoint of each square; its middle may be on the other side of a wall.
        squares = ((eyes - corner) / _APART).astype(int)
        _, chosen = np.unique(squares, axis=0, return_index=True)
        free_rays(kinds, corner, eyes[chosen], _SIGHT)
        # What a robot saw from there it may have entered, and seen more.
        eyes = corner + (np.argwhere(kinds == FREE)[:, ::-1] + 0.5) * CELL
    ground = _with_distances(kinds, corner)
    assert ground is not None  # There are walls.
    return ground


@kernel(arrays=True)
def free_rays(kinds: np.ndarray, corner: np.ndarray, eyes: np.ndarray, sight: float) -> None:
    """Mark the ground as free that is seen from some points; only rays that end at a wall count.

    A ray that meets no wall may have left through a wall that the map lacks.
    """
    rows, columns = kinds.shape
    steps = int(sight / (0.5 * CELL))
    for e in range(len(eyes)):
        for k in range(_RAYS):
            bearing = 2.0 * math.pi * k / _RAYS
            ux, uy = 0.5 * math.cos(bearing), 0.5 * math.sin(bearing)
            x0, y0 = (eyes[e, 0] - corner[0]) / CELL, (eyes[e, 1] - corner[1]) / CELL
            end = -1
            for n in range(steps):
                column, row = int(x0 + n * ux), int(y0 + n * uy)
                if not (0 <= row < rows and 0 <= column < columns):
                    break
                if kinds[row, column] == WALL:
                    end = n
                    break
            for n in range(end):
                column, row = int(x0 + n * ux), int(y0 + n * uy)
                if kinds[row, column] == UNKNOWN:
                    kinds[row, column] = FREE


def _with_distances(kinds: UInt8[np.ndarray, "rows columns"], corner: Points) -> Ground | None:
    """Return the ground with the distances from its walls; None if it has no walls."""
    if not (kinds == WALL).any():
        return None
    far = distance_transform_edt(kinds != WALL) * CELL
    centimetres = np.round(100.0 * np.minimum(far, FARTHEST)).astype(np.uint8)
    return Ground(kinds, centimetres, np.asarray(corner, np.float64))


def _field_of(
    walls: Points, config: FieldConfig, source: object, around: Points
) -> LikelihoodField:
    """Return the likelihood field of points on walls, large enough for all points `around`."""
    low, high = around.min(axis=0), around.max(axis=0)
    # Room for the stamp of a point, for the coarse levels before it and for vectors after it.
    border = 6.0 * config.sigma + ((2 << config.levels) + 16) * config.cell
    half = 0.5 * float(max(high - low)) + border
    if half > _LARGEST:
        expected = f"a map of at most {2 * _LARGEST:g} m"
        raise InputError(source, expected, f"{max(high - low):.0f} m")
    field = LikelihoodField(replace(config, half=half))
    field.clear(0.5 * (low + high))
    field.add(np.zeros(3), walls)
    return field


def _blocks_of(
    coarse: LikelihoodField, is_open: np.ndarray
) -> tuple[UInt8[np.ndarray, "phases wide wide"], np.ndarray]:
    """Return the bounds of blocks of cells, and in which blocks the robot may stand.

    Entry [p * BLOCK + q, r, c] of the bounds is the largest likelihood of the `BLOCK` by `BLOCK`
    cells that begin at row BLOCK * r + p and column BLOCK * c + q. So neighbouring blocks are
    neighbouring bytes, whatever a point's offset, and are summed together.
    """
    level = coarse.levels[BLOCK_BITS]
    wide = len(level) // BLOCK
    part = level[: wide * BLOCK, : wide * BLOCK].reshape(wide, BLOCK, wide, BLOCK)
    bounds = np.ascontiguousarray(part.transpose(1, 3, 0, 2)).reshape(BLOCK * BLOCK, wide, wide)
    opens = is_open[: wide * BLOCK, : wide * BLOCK].reshape(wide, BLOCK, wide, BLOCK)
    return bounds, np.asarray(opens.any(axis=(1, 3)))


def _open_cells(ground: Ground, coarse: LikelihoodField) -> np.ndarray:
    """Return in which cells of a field the robot may stand: known, free and not at a wall."""
    standing = (ground.kinds == FREE) & (ground.distances >= 100.0 * _BODY)
    rows, columns = np.nonzero(standing)
    points = (np.stack((columns, rows), axis=-1) + 0.5) * CELL + ground.corner
    where = ((points - coarse.corner) / coarse.config.cell).astype(int)
    side = coarse.config.side
    inside = ((where >= 0) & (where < side)).all(axis=1)
    is_open = np.zeros((side, side), np.bool_)
    is_open[where[inside, 1], where[inside, 0]] = True
    return is_open
