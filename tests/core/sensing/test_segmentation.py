"""Where clusters part, and which ends are cut by the laser's range, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.mapper import Albot1
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from albot_core.sensing.segmentation import set_gaps
from albot_core.sensing.view import NO_EDGE, OCCLUDING, ViewConfig, construct_view


def directions(beams: int, spacing: float) -> np.ndarray:
    angles = np.arange(beams) * spacing
    return np.stack((np.cos(angles), np.sin(angles)), axis=-1)


@pytest.mark.parametrize("spacing", np.radians([0.5, 1.0, 2.0]).tolist())
def test_the_gap_is_that_of_a_wall_met_at_the_least_angle(spacing: float) -> None:
    # Two neighbouring beams meet one wall, the farther one at 10 degrees less the step.
    least, first = np.radians(10.0), 20.0
    last = first * np.sin(least) / np.sin(least - spacing)
    apart = np.hypot(last * np.cos(spacing) - first, last * np.sin(spacing))
    gaps, ranges = np.empty(2), np.array((first, last))
    set_gaps(ranges, directions(2, spacing), np.arange(2), 0.6, least, gaps)
    assert gaps.tolist() == pytest.approx([0.6, apart])


def test_no_gap_is_wider_across_a_missing_beam_or_nearby() -> None:
    gaps, ranges = np.empty(3), np.array((20.0, 20.0, np.inf, 20.0))
    set_gaps(ranges, directions(4, 0.03), np.array((0, 1, 3)), 0.6, np.radians(10.0), gaps)
    assert gaps[1] > 1.0 and gaps[2] == 0.6
    set_gaps(ranges / 20.0, directions(4, 0.03), np.arange(3), 0.6, np.radians(10.0), gaps)
    assert gaps.tolist() == [0.6] * 3


@pytest.mark.parametrize("beams", [13, 31])
def test_a_coarse_laser_draws_no_wall_from_a_screen_to_the_wall_behind(beams: int) -> None:
    # The screen is 2 m ahead and reaches 30° to both sides; the wall is 3 m ahead.
    geometry = LaserGeometry(beams=beams, spacing=np.pi / (beams - 1))
    depths = np.where(np.abs(geometry.bearings) < np.radians(31.0), 2.0, 3.0)
    with np.errstate(divide="ignore"):
        ranges = np.where(np.cos(geometry.bearings) > 0.1, depths / np.cos(geometry.bearings), 40)
    config = ViewConfig(min_incidence=np.radians(10.0), fit_lines=True)
    surfaces = construct_view(LaserScan(ranges=ranges, geometry=geometry), config).surfaces
    assert len(surfaces)
    np.testing.assert_allclose(surfaces[:, 0], surfaces[:, 2])


def along_a_wall(max_range: float) -> LaserScan:
    """A wall 2 m to the left of a robot, which ends 6 m ahead; another 3 m to the right."""
    geometry = LaserGeometry(beams=181, spacing=np.radians(1.0), max_range=max_range)
    with np.errstate(divide="ignore"):
        left, right = 2.0 / np.sin(geometry.bearings), -3.0 / np.sin(geometry.bearings)
    left[(left < 0) | (left * np.cos(geometry.bearings) > 6.0)] = np.inf
    right[right < 0] = np.inf
    ranges = np.minimum(left, right)
    ranges[ranges >= max_range] = np.inf
    return LaserScan(ranges=ranges, geometry=geometry)


@pytest.mark.parametrize(
    ("max_range", "cut", "edge"),
    [(8.0, True, OCCLUDING), (5.0, True, NO_EDGE), (5.0, False, OCCLUDING)],
)
def test_a_wall_that_leaves_the_range_has_no_end_there(
    max_range: float, cut: bool, edge: int
) -> None:
    config = ViewConfig(min_incidence=np.radians(10.0), cut_ends=cut)
    view = construct_view(along_a_wall(max_range), config)
    left = view.surfaces[:, 1] > 1.0
    assert left.sum() == 1
    assert view.edges[left][0, 0] == edge


def with_wide_beams(width: float) -> LaserScan:
    """`along_a_wall` without an end, by beams that measure the nearest of what they meet."""
    geometry = LaserGeometry(spacing=np.radians(1.0), beam_width=width, max_range=12.0)
    across = geometry.bearings + np.linspace(-0.5, 0.5, 101)[:, None] * width
    with np.errstate(divide="ignore"):
        walls = np.where(np.sin(across) > 0, 2.0, 3.0) / np.abs(np.sin(across))
    ranges = walls.min(axis=0)
    ranges[ranges >= geometry.max_range] = np.inf
    return LaserScan(ranges=ranges, geometry=geometry)


def inward(surfaces: np.ndarray) -> np.ndarray:
    """How far long surfaces beside the robot are turned towards it (rad)."""
    run = surfaces[:, 2:] - surfaces[:, :2]
    long = np.hypot(*run.T) > 4.0
    assert long.sum() == 2
    turned = np.arctan(run[long, 1] / run[long, 0])
    return -np.sign(surfaces[long, 1]) * turned


@pytest.mark.parametrize("degrees", [0.25, 0.5, 1.0])
def test_a_wall_seen_by_wide_beams_is_not_turned(degrees: float) -> None:
    width = np.radians(degrees)
    args = {"min_incidence": np.radians(10.0), "fit_lines": True}
    on_axes = construct_view(with_wide_beams(width), ViewConfig(**args)).surfaces
    at_edges = construct_view(with_wide_beams(width), ViewConfig(**args, beam_model=True)).surfaces
    assert inward(on_axes) == pytest.approx(0.5 * width, rel=0.15)
    assert np.abs(inward(at_edges)).max() < 0.05 * width


def test_albot1_lays_walls_seen_by_wide_beams_where_they_are() -> None:
    mapper = Albot1()
    scan = with_wide_beams(np.radians(0.5))
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=scan))
    assert np.abs(inward(mapper.snapshot().segments)).max() < np.radians(0.02)
