"""The sonars hear the same by lists of the walls that matter near by as by all walls."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString

from albot_benchmarks.laser import floor_plan
from albot_env.sim.plane_geometry import transform_of
from albot_env.sim.sonar import SONARS, SonarConfig, sonar_wall_index
from albot_env.sim.sonar_echoes import make_sonar_buffers
from albot_env.sim.sonar_kernels import measure_echoes
from tests.env.sim.test_rays import segments
from tests.env.sim.whereabouts import cells_of, poses_about

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
