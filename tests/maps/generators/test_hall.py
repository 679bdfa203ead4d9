"""Halls: the furniture in them."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from albot_maps import load_world
from albot_maps.freespace import floor_at


@pytest.mark.parametrize(
    ("clutter", "symmetry", "pieces"),
    [(0, "false", 0), (0.05, "false", 12), (0, "true", 0), (0.05, "true", 12)],
)
def test_there_is_a_piece_of_furniture_for_each_5_square_metres_at_full_clutter(
    clutter: float, symmetry: str, pieces: int
) -> None:
    """Of 1,200 m², in which so few pieces all fit."""
    size = f"width=40&depth=30&clutter={clutter}&symmetry={symmetry}"
    world = load_world(f"random:hall:3?{size}&pillars=0&porches=0")
    floor = floor_at(world.walls, world.starts[0, :2])
    areas = shapely.area(shapely.get_parts(shapely.difference(shapely.box(0, 0, 40, 30), floor)))
    assert np.count_nonzero(areas) == pieces
    assert areas.max() < 2.3
