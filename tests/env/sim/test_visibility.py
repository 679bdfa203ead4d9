"""Lists of walls hold all that is seen or heard from their cell, and little more."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString

from albot_benchmarks.laser import floor_plan
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import RayCaster
from albot_env.sim.laser import laser_wall_index
from albot_env.sim.plane_geometry import transform_of
from albot_env.sim.sonar import SONARS, SonarConfig, sonar_wall_index
from albot_env.sim.sonar_echoes import make_sonar_buffers
from albot_env.sim.sonar_kernels import measure_echoes
from albot_env.sim.wall_index import Locator, WallIndex
from albot_maps import load_world
from tests.env.sim.test_laser import poses_about, segments

FAN = LaserGeometry(beams=720, first_bearing=-np.pi, spacing=np.pi / 360, max_range=30.0)


def cells_of(index: WallIndex, poses: np.ndarray) -> np.ndarray:
    """The cells of the first building's poses, whose walls are listed now."""
    count = len(poses)
    cells, unused = np.empty(count, np.int64), np.empty(count, np.int64)
    nothing = WallIndex(0.0, (0.0, 0.0))
    rows, building = np.arange(count), np.zeros(count, np.int64)
    Locator(index, nothing).locate(rows, building, poses, cells, unused)
    return cells


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


NOTHING = np.empty((0, 4))


def differing(config: SonarConfig, walls: np.ndarray, poses: np.ndarray) -> int:
    """How many echoes differ, by lists and by all walls, by more than rounding."""
    index = sonar_wall_index(config)
    index.add(walls)
    cells = cells_of(index, poses)
    tables, everything = index.tables, np.arange(len(walls), dtype=np.int32)
    sonars, count = config.constants, len(config.geometry.bearings)
    cones = make_sonar_buffers(len(walls), count)
    echoes = np.empty((2, len(poses), count))
    for k, pose in enumerate(poses):
        first, last = tables.spans[cells[k]]
        for which, near in enumerate((tables.members[first:last], everything)):
            at = walls, near, NOTHING, transform_of(pose), sonars, np.uint64(7), count * k, cones
            measure_echoes(*at, echoes[which, k])
    return int((~np.isclose(*echoes, rtol=1e-12)).sum())


@pytest.mark.parametrize("name", SONARS)
@pytest.mark.parametrize("count", [60, 200])
def test_in_floor_plans(count: int, name: str) -> None:
    rng = np.random.default_rng(count)
    walls = floor_plan(count, rng)
    assert differing(SONARS[name], walls, poses_about(walls, 1.0, 2000, rng)) == 0


def without_crossings(lines: list[tuple[float, float, float, float]]) -> np.ndarray:
    """Those of some segments that cross none of those before them."""
    kept: list[LineString] = []
    for line in (LineString((line[:2], line[2:])) for line in lines):
        if not any(line.crosses(other) for other in kept):
            kept.append(line)
    return shapely.get_coordinates(kept).reshape(-1, 4)


@settings(deadline=None, max_examples=100)
@given(walls=st.lists(segments, min_size=3, max_size=40).map(without_crossings))
def test_in_tangles(walls: np.ndarray) -> None:
    """Walls on a grid of quarter metres share ends, touch, and hang together in chains.

    Where two walls cross there is a corner only if a third one ends there, which may be hidden.
    """
    rng = np.random.default_rng(len(walls))
    poses = np.column_stack((rng.uniform(-3.5, 3.5, (100, 2)), rng.uniform(-4, 4, 100)))
    assert differing(SONARS["pioneer"], walls, poses) == 0
