"""The ground of a world: how much can be reached, and grids to tick it off."""

from __future__ import annotations

import shapely

from albot_env.tasks.coverage import Coverage, CoverageConfig
from albot_maps import ROBOT_RADIUS, World

MARGIN = 5.0
"""How far beyond the building's own size a belief may stray and still be kept (m)."""


def reachable_area(world: World) -> float:
    """The ground that the robot's body can touch, coming from the first start (m²)."""
    middle = world.free_space.region_at(world.starts[0, :2])
    return float(shapely.buffer(middle, ROBOT_RADIUS).area)


def world_coverage(world: World, config: CoverageConfig) -> Coverage:
    """Coverage in the world's frame, large enough for the whole world."""
    x_min, y_min, x_max, y_max = world.bounds
    extent = max(x_max - x_min, y_max - y_min) / 2 + config.cell
    return Coverage(config, extent, ((x_min + x_max) / 2, (y_min + y_max) / 2))


def map_coverage(world: World, config: CoverageConfig) -> Coverage:
    """Coverage in the map's frame, large enough wherever in the world the robot set out."""
    x_min, y_min, x_max, y_max = world.bounds
    diagonal = ((x_max - x_min) ** 2 + (y_max - y_min) ** 2) ** 0.5
    return Coverage(config, diagonal + MARGIN)
