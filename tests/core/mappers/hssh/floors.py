"""Drawn floors whose gateways are known: as cells for the local map, and as walls for a laser."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from albot_core.mappers.hssh.gateways import FREE, WALL, Ground

CELL = 0.1
Box = tuple[float, float, float, float]
ROOMS: tuple[Box, ...] = ((0, 0, 4, 4), (4, 1.5, 4.2, 2.5), (4.2, 0, 8.2, 4))
"""Two rooms of 4 x 4 m, with a door of 1 m in a wall of 20 cm between them (m)."""
CROSS: tuple[Box, ...] = ((-6, -1, 6, 1), (-1, -6, 1, 6))
"""Two corridors of 2 m that cross (m)."""
TEE: tuple[Box, ...] = ((-6, -1, 6, 1), (-1, -6, 1, 1))
CORNER: tuple[Box, ...] = ((-6, -1, 1, 1), (-1, -6, 1, 1))
DOOR_IN_CORRIDOR: tuple[Box, ...] = ((-7, -1, 7, 1), (1, 1, 2, 1.2), (-1, 1.2, 4, 5))
"""A corridor of 2 m along a room, with a door of 1 m (m)."""
BLOCK: tuple[Box, ...] = ((-1, -1, 11, 1), (9, -1, 11, 9), (-1, 7, 11, 9), (-1, -1, 1, 9))
"""A corridor of 2 m round a block of 8 x 6 m (m)."""


def floor_of(boxes: Sequence[Box], turn: float = 0.0) -> shapely.Geometry:
    """The free ground of boxes, turned about the origin (rad)."""
    ground = shapely.union_all([shapely.box(*box) for box in boxes])
    return shapely.affinity.rotate(ground, turn, origin=(0, 0), use_radians=True)


def ground_of(boxes: Sequence[Box], turn: float = 0.0, offset: float = 0.0) -> Ground:
    """The cells whose centres are free, with walls around."""
    floor = floor_of(boxes, turn)
    x1, y1, x2, y2 = floor.bounds
    corner = np.array((x1 - 3 * CELL + offset, y1 - 3 * CELL + offset))
    columns, rows = (int(np.ceil(side / CELL)) + 6 for side in (x2 - x1, y2 - y1))
    x = corner[0] + (np.arange(columns) + 0.5) * CELL
    y = corner[1] + (np.arange(rows) + 0.5) * CELL
    free = shapely.contains_xy(floor, *np.meshgrid(x, y))
    return Ground(np.where(free, FREE, WALL).astype(np.int8), corner, CELL)


def walls_of(boxes: Sequence[Box]) -> np.ndarray:
    """The walls around the free ground (m)."""
    floor = floor_of(boxes)
    lines = []
    for ring in (floor.exterior, *floor.interiors):
        points = np.array(ring.coords)
        lines.append(np.hstack((points[:-1], points[1:])))
    return np.vstack(lines)
