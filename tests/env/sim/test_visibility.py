"""Lists of walls hold little more than what is seen from somewhere in their cell."""

from __future__ import annotations

import numpy as np

from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import RayCaster
from albot_env.sim.laser import laser_wall_index
from albot_maps import load_world
from tests.env.sim.whereabouts import cells_of, poses_about

FAN = LaserGeometry(beams=720, first_bearing=-np.pi, spacing=np.pi / 360, max_range=30.0)


def seen_from(walls: np.ndarray, rays: RayCaster, places: np.ndarray) -> set[int]:
    """The walls that dense fans of beams from some places end at."""
    seen: set[int] = set()
    a, along = walls[:, np.newaxis, :2], walls[:, np.newaxis, 2:] - walls[:, np.newaxis, :2]
    beams = np.stack((np.cos(FAN.bearings), np.sin(FAN.bearings)), axis=1)
    for place in places:
        ranges = rays.scan(np.append(place, 0.0))
        hit = np.isfinite(ranges)
        ends = place + ranges[hit, np.newaxis] * beams[hit] - a
        share = np.clip((ends * along).sum(axis=2) / (along**2).sum(axis=2), 0.0, 1.0)
        apart = np.linalg.norm(ends - share[:, :, np.newaxis] * along, axis=2)
        seen |= set(apart.argmin(axis=0).tolist())
    return seen


def test_lists_are_at_most_twice_as_long_as_need_be() -> None:
    world = load_world("random:office:3?rooms=10")
    index, rays, rng = laser_wall_index(FAN), RayCaster(world.walls, FAN), np.random.default_rng(0)
    index.add(world.walls)
    cells = cells_of(index, poses_about(world.walls, 0.0, 20, rng))
    listed, seen = 0, 0
    left, bottom, side, columns = index.tables.frames[0, :4]
    for cell in np.unique(cells):
        first, last = index.tables.spans[cell]
        corner = left + side * (cell % columns), bottom + side * (cell // columns)
        places = corner + side * rng.random((12, 2))
        listed += last - first
        seen += len(seen_from(world.walls, rays, places))
    assert listed <= 2 * seen
    assert seen > 10 * len(np.unique(cells))
