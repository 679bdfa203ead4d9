"""Surfaces in an occupancy grid, of a room that is drawn by hand and of one that was mapped."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose
from albot_core.mappers.slam.scan_matching import ScanMatching
from albot_core.maps.layers import MapSnapshot, OccupancyGridLayer, SegmentsLayer
from albot_core.maps.outlines import outlines, surfaces_of
from tests.core.mappers.slam.rooms import ROOM
from tests.core.mappers.slam.test_scan_matching import drive, lap


def box(rows: int, columns: int) -> OccupancyGridLayer:
    """A room whose walls are one cell thick, with nothing known outside."""
    occupancy = np.full((rows + 4, columns + 4), np.nan, np.float32)
    occupancy[1:-1, 1:-1] = 0.9
    occupancy[2:-2, 2:-2] = 0.1
    return OccupancyGridLayer(
        origin=np.array((3.0, -1.0, np.pi / 2)), resolution=0.1, occupancy=occupancy
    )


def lengths(segments: np.ndarray) -> np.ndarray:
    return np.hypot(*(segments[:, 2:] - segments[:, :2]).T)


def test_each_wall_is_one_line_on_its_inner_side():
    walls = outlines(box(30, 50))
    # The border of free and occupied is halfway between the middles of their cells.
    assert np.sort(lengths(walls))[-4:] == pytest.approx((3.0, 3.0, 5.0, 5.0), abs=0.15)
    assert lengths(walls).sum() == pytest.approx(16.0, abs=0.3)
    ends = walls.reshape(-1, 2)
    # The frame of the grid is turned: its columns run along y, its rows against x.
    assert ends.min(axis=0) == pytest.approx((3.0 - 0.2 - 3.0, -1.0 + 0.2), abs=0.02)
    assert ends.max(axis=0) == pytest.approx((3.0 - 0.2, -1.0 + 0.2 + 5.0), abs=0.02)


def test_specks_and_what_borders_on_the_unknown_are_left_out():
    grid = box(30, 50)
    grid.occupancy[10, 10] = 0.9
    walls = outlines(box(30, 50))
    # A cell has a contour of 0.28 m.
    np.testing.assert_array_equal(outlines(grid, shortest=0.3), walls)
    assert len(outlines(grid)) == len(walls) + 4
    grid.occupancy[2:-2, 2:-2] = np.nan
    assert not len(outlines(grid))


@pytest.mark.parametrize("shape", [(0, 0), (1, 5), (2, 2)])
def test_a_grid_too_small_for_any_has_none(shape):
    grid = OccupancyGridLayer(
        origin=np.zeros(3), resolution=0.1, occupancy=np.full(shape, np.nan, np.float32)
    )
    assert outlines(grid).shape == (0, 4)


def test_the_walls_of_a_mapped_room():
    mapper, poses = ScanMatching(), lap()
    drive(mapper, poses, np.random.default_rng(0), 0.0, 0.0)
    found = surfaces_of(mapper.snapshot()).reshape(-1, 2)
    x, y, _ = compose(poses[0], np.c_[found, np.zeros(len(found))]).T
    off = np.min([abs(x + 4), abs(x - 5), abs(y + 3), abs(y - 4), abs(x - 1)], axis=0)
    assert np.quantile(off, 0.9) < 0.1
    seen = lengths(surfaces_of(mapper.snapshot())).sum()
    assert seen == pytest.approx(lengths(ROOM)[:4].sum() + 3.0, rel=0.15)


def test_a_map_with_lines_keeps_its_own():
    lines = SegmentsLayer(segments=np.array(((0.0, 0.0, 1.0, 0.0),)))
    snapshot = MapSnapshot(layers=(box(30, 50), lines))
    np.testing.assert_array_equal(surfaces_of(snapshot), lines.segments)
    assert not len(surfaces_of(MapSnapshot()))
