"""Coverage against slow and closed-form answers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.sensing.reading import LaserGeometry, LaserScan
from albot_env.tasks.core.coverage import CoverageConfig, empty_coverage, with_coverage
from albot_env.tasks.core.coverage_kernels import cover, is_covered
from tests.env.tasks.oracles import Coverage

CONFIG = CoverageConfig()
NOWHERE = LaserScan(ranges=np.full(181, np.inf), geometry=LaserGeometry())


def _wall_at(distance: float) -> LaserScan:
    return LaserScan(ranges=np.full(181, distance), geometry=LaserGeometry())


def test_open_ground_is_half_a_disc() -> None:
    fine = CoverageConfig(cell=0.05)
    area = Coverage(fine, 5.0).add(np.array((0.3, -0.2, 1.0)), NOWHERE)
    assert area == pytest.approx(np.pi * fine.radius**2 / 2, rel=0.05)


def test_a_wall_hides_what_is_behind_it() -> None:
    fine = CoverageConfig(cell=0.05)
    area = Coverage(fine, 5.0).add(np.zeros(3), _wall_at(1.0))
    assert area == pytest.approx(np.pi / 2, rel=0.1)


def test_the_same_look_again_covers_nothing_new() -> None:
    coverage = Coverage(CONFIG, 5.0)
    first = coverage.add(np.zeros(3), NOWHERE)
    assert first > 0
    assert coverage.add(np.zeros(3), NOWHERE) == 0
    assert coverage.area == first
    coverage.clear()
    assert coverage.area == 0
    assert coverage.add(np.zeros(3), NOWHERE) == first


@given(st.floats(-40, 40), st.floats(-40, 40), st.floats(-4, 4))
@settings(deadline=None)
def test_ground_beyond_the_square_is_left_out(x: float, y: float, heading: float) -> None:
    coverage = Coverage(CONFIG, 3.0, (1.0, -2.0))
    coverage.add(np.array((x, y, heading)), NOWHERE)
    assert 0 <= coverage.area <= 36


@given(
    st.floats(-3, 3), st.floats(-3, 3), st.floats(-np.pi, np.pi), st.integers(0, 15),
    st.integers(0, 15),
)  # fmt: skip
@settings(deadline=None)
def test_the_patch_shows_the_cells_it_says(
    x: float, y: float, heading: float, row: int, column: int
) -> None:
    """The slow way: where the patch's cell lies in the frame, and whether that is covered."""
    coverage = Coverage(CONFIG, 8.0)
    coverage.add(np.array((0.5, 0.5, 0.7)), _wall_at(1.5))
    patch = coverage.patch(np.array((x, y, heading)))[0]
    ahead, left = (7.5 - row) * CONFIG.patch_cell, (7.5 - column) * CONFIG.patch_cell
    px = x + np.cos(heading) * ahead - np.sin(heading) * left
    py = y + np.sin(heading) * ahead + np.cos(heading) * left
    far = np.hypot(px - 0.5, py - 0.5)
    facing = np.cos(0.7) * (px - 0.5) + np.sin(0.7) * (py - 0.5)
    if far < 1.1 and facing > 0.4:
        assert patch[row, column] == 1
    elif far > 1.9 or facing < -0.4:
        assert patch[row, column] == -1


@settings(deadline=None)
@given(
    st.integers(2, 19),
    st.floats(0.1, 0.9),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-np.pi, np.pi)),
    st.integers(0, 2**32 - 1),
)
def test_a_patch_of_any_size_shows_the_cells_under_its_middles(
    width: int, patch_cell: float, pose: tuple[float, float, float], seed: int
) -> None:
    """The slow way, on ground covered at random; what lies beyond it is not covered."""
    config = CoverageConfig(patch_cells=width, patch_cell=patch_cell)
    coverage = Coverage(config, 4.0, (1.0, -2.0))
    grids = coverage.ground.grids
    grids[:] = np.random.default_rng(seed).integers(0, 2**64, grids.shape, np.uint64)
    patch = coverage.patch(np.array(pose))[0]
    ahead, left = patch_cell * ((width - 1) / 2 - np.mgrid[:width, :width])
    x = pose[0] + np.cos(pose[2]) * ahead - np.sin(pose[2]) * left
    y = pose[1] + np.sin(pose[2]) * ahead + np.cos(pose[2]) * left
    for row, column in np.ndindex(width, width):
        around = {
            is_covered(coverage.ground, 0, x[row, column] + dx, y[row, column] + dy)
            for dx in (-1e-6, 1e-6)
            for dy in (-1e-6, 1e-6)
        }
        if len(around) == 1:
            assert patch[row, column] == (1 if around.pop() else -1)


def test_sizes_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"CoverageConfig\.cell"):
        CoverageConfig(cell=0.0)
    with pytest.raises(InputError, match=r"CoverageConfig\.patch_cells"):
        CoverageConfig(patch_cells=1)


def test_reachable_ground_of_two_rooms(two_rooms) -> None:
    # 40 m² of floor; the body reaches all but a little in each of the sixteen corners.
    assert two_rooms.reachable_area == pytest.approx(40.0, rel=0.01)


def _all_round(range_: float) -> LaserScan:
    return LaserScan(geometry=WIDE, ranges=np.full(WIDE.beams, range_))


WIDE = LaserGeometry(beams=360, first_bearing=-np.pi, spacing=np.pi / 180)


@pytest.mark.parametrize(("turn", "range_"), [(0.0, 9.0), (1.0, 9.0), (-2.5, np.inf)])
def test_the_frontier_is_where_covered_ground_ends(turn: float, range_: float) -> None:
    """Covered is a disc of 2 m about the origin; from beside its middle it ends nearer ahead."""
    config = CoverageConfig(cell=0.1)
    coverage = Coverage(config, 10.0)
    coverage.add(np.zeros(3), _all_round(9.0))
    aside = 1.2
    found = coverage.frontier(np.array((aside, 0.0, turn)), _all_round(range_), 36)
    bearings = turn - np.pi + (np.arange(36) * 10 + 5) * np.pi / 180
    ends = np.sqrt(4 - (aside * np.sin(bearings)) ** 2) - aside * np.cos(bearings)
    # A beam that leaves it aslant has its neighbours still inside for a while.
    np.testing.assert_array_less(ends - 0.15, found)
    np.testing.assert_array_less(found, ends + 0.35)


def test_no_frontier_is_seen_where_a_wall_is_before_it() -> None:
    coverage = Coverage(CoverageConfig(cell=0.1), 10.0)
    coverage.add(np.zeros(3), _all_round(1.5))
    assert np.all(np.isinf(coverage.frontier(np.zeros(3), _all_round(1.5), 36)))
    opened = np.full(WIDE.beams, 1.5)
    opened[170:190] = 6.0
    scan = LaserScan(geometry=WIDE, ranges=opened)
    found = coverage.frontier(np.zeros(3), scan, 36)
    assert np.isfinite(found).nonzero()[0].tolist() == [17, 18]


@settings(deadline=None)
@given(
    st.integers(2, 361),
    st.floats(0.0005, 0.0174),
    st.floats(-np.pi, np.pi),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-np.pi, np.pi)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-np.pi, np.pi)),
)
def test_what_is_behind_a_laser_is_passed_over_and_nothing_else(
    beams: int,
    spacing: float,
    first: float,
    mount: tuple[float, float, float],
    pose: tuple[float, float, float],
) -> None:
    geometry = LaserGeometry(beams=beams, spacing=spacing, first_bearing=first, mount=mount)
    sensor, ranges = CONFIG.sensor(geometry), np.full(beams, np.inf)
    grids = []
    for looking in (sensor, sensor._replace(ahead=-1.0)):
        ground = with_coverage(empty_coverage(1, CONFIG.cell), 0, CONFIG.side(4.0), (0.0, 0.0))
        cover(ground, 0, np.array(pose), (np.cos(pose[2]), np.sin(pose[2])), looking, ranges)
        grids.append(ground.grids.copy())
    np.testing.assert_array_equal(*grids)


@pytest.mark.parametrize(
    "mount", [(0.6, 0.0, 0.0), (0.0, -0.9, 0.0), (0.3, 0.5, 1.2), (-0.4, 0.2, -2.9)]
)
def test_a_laser_mounted_aside_covers_what_it_sees_from_there(
    mount: tuple[float, float, float],
) -> None:
    """The slow way: half a disc about the laser, open to where it looks."""
    x, y, heading = pose = (0.3, -0.2, 1.0)
    geometry = LaserGeometry(mount=mount)
    coverage = Coverage(CoverageConfig(cell=0.05), 5.0)
    coverage.add(np.array(pose), LaserScan(ranges=np.full(181, np.inf), geometry=geometry))
    eye = complex(x, y) + complex(*mount[:2]) * np.exp(1j * heading)
    facing = np.exp(1j * (heading + mount[2]))
    checked = 0
    for east, north in np.random.default_rng(1).uniform(-3, 3, (2000, 2)):
        seen = (complex(east, north) - eye) / facing
        if abs(abs(seen) - CONFIG.radius) < 0.1 or abs(seen.real) < 0.1:
            continue
        wanted = abs(seen) < CONFIG.radius and seen.real > 0
        assert is_covered(coverage.ground, 0, east, north) == wanted
        checked += wanted
    assert checked > 200
