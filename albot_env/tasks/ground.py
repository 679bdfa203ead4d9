"""The ground of worlds: how large a square holds it, and grids that keep what is covered."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import UInt64

from albot_env.tasks.ground_kernels import Ground
from albot_maps import World

MARGIN = 5.0
"""How far beyond the building's own size a belief may stray and still be kept (m)."""


def world_centre(world: World) -> tuple[float, float]:
    """The middle of the world (m)."""
    x_min, y_min, x_max, y_max = world.bounds
    return (x_min + x_max) / 2, (y_min + y_max) / 2


def world_extent(world: World) -> float:
    """How far (m) from its middle the world reaches along the axes."""
    x_min, y_min, x_max, y_max = world.bounds
    return max(x_max - x_min, y_max - y_min) / 2


def map_extent(world: World) -> float:
    """How far (m) from its origin a map reaches, wherever in the world the robot set out."""
    x_min, y_min, x_max, y_max = world.bounds
    return math.hypot(x_max - x_min, y_max - y_min) + MARGIN


def no_ground(robots: int, cell: float) -> Ground:
    """The ground of so many robots, in cells of that size (m); all is still to be laid."""
    return Ground(
        grids=np.zeros((robots, 0), np.uint64),
        sides=np.zeros(robots, np.int64),
        centres=np.zeros((robots, 2)),
        cell=cell,
    )


def words_of(ground: Ground, row: int) -> UInt64[np.ndarray, "words"]:
    """A robot's own words, to be read and written."""
    words: UInt64[np.ndarray, "words"] = ground.grids[row, : (ground.sides[row] // 8) ** 2]
    return words


def laid(ground: Ground, row: int, side: int, centre: tuple[float, float]) -> Ground:
    """The ground with an uncovered square of so many cells for one robot.

    These are the same arrays, written over; larger ones only where that is needed.
    """
    words = (side // 8) ** 2
    robots, room = ground.grids.shape
    if words > room:
        added = np.zeros((robots, words - room), np.uint64)
        ground = ground._replace(grids=np.concatenate((ground.grids, added), axis=1))
    ground.grids[row] = 0
    ground.sides[row], ground.centres[row] = side, centre
    return ground
