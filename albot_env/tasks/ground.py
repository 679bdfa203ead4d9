"""The ground of a world: how large a square holds it."""

from __future__ import annotations

import math

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
