"""View construction on scenes whose surfaces are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, transform_segments
from albot_core.sensing.reading import LaserGeometry, LaserScan
from albot_core.sensing.view import CORNER, NO_EDGE, OCCLUDING, View, ViewConfig, construct_view
from tests.core.scenes import ROOM, scan_from

ORIGIN = np.zeros(3)


def view_of(walls: list[list[float]], **config: object) -> View:
    return construct_view(
        scan_from(ORIGIN, np.array(walls)),
        ViewConfig(**config),  # type: ignore[arg-type]
    )


def test_a_wall_ahead_is_one_surface_from_right_to_left() -> None:
    view = view_of([[3.0, -1.0, 3.0, 1.0]])
    assert view.surfaces.shape == (1, 4)
    # The outermost beams meet the wall within one beam's spacing of its ends.
    assert np.allclose(view.surfaces[0], [3.0, -1.0, 3.0, 1.0], atol=3.4 * np.radians(1))
    assert not view.edges.any()


def test_two_walls_meet_in_a_corner_point() -> None:
    view = view_of([[3.0, -2.0, 3.0, 2.0], [3.0, 2.0, 0.5, 2.0]], fit_lines=True)
    assert len(view.surfaces) == 2
    assert view.edges.tolist() == [[NO_EDGE, CORNER], [CORNER, NO_EDGE]]
    assert np.allclose(view.surfaces[0, 2:], [3.0, 2.0], atol=1e-6)
    assert np.allclose(view.surfaces[1, :2], [3.0, 2.0], atol=1e-6)


def test_the_nearer_of_two_ends_occludes() -> None:
    view = view_of([[2.0, -1.0, 2.0, 0.5], [4.0, -3.0, 4.0, 3.0]])
    near = int(np.argmin(np.abs(view.surfaces[:, 0] - 2.0)))
    assert view.edges[near].tolist() == [OCCLUDING, OCCLUDING]
    far = [k for k in range(len(view.surfaces)) if k != near]
    assert len(far) == 2
    assert not view.edges[far].any()


@pytest.mark.parametrize("fit", [False, True])
def test_an_end_obstructs_unless_its_wall_goes_on(fit: bool) -> None:
    # A wall a metre to the left: from six metres on its points are farther apart than a robot.
    aslant = [[1.0, 1.0, 14.0, 1.0], [14.0, -3.0, 14.0, 1.0]]
    for grazing, edge in ((True, OCCLUDING), (False, NO_EDGE)):
        assert view_of(aslant, fit_lines=fit, grazing_ends=grazing).edges[-1, 0] == edge
    # It ends there, and something stands beyond: what is seen past it lies off its line.
    before_another = [[1.0, 1.0, 4.0, 1.0], [9.0, -4.0, 9.0, 4.0]]
    assert view_of(before_another, fit_lines=fit).edges[-1, 0] == OCCLUDING


def test_gaps_wider_than_the_robot_split_and_narrower_do_not() -> None:
    for gap, surfaces in ((0.8, 2), (0.4, 1)):
        walls = [[2.0, -1.5, 2.0, -gap / 2], [2.0, gap / 2, 2.0, 1.5]]
        assert len(view_of(walls).surfaces) == surfaces


def test_a_dent_shallower_than_the_break_height_is_overlooked() -> None:
    for depth, surfaces in ((0.05, 1), (0.3, 2)):
        walls = [[3.0, -2.0, 3.0 + depth, 0.0], [3.0 + depth, 0.0, 3.0, 2.0]]
        assert len(view_of(walls).surfaces) == surfaces


def test_landmarks_are_long_and_have_a_stable_end() -> None:
    view = View(
        surfaces=np.array([[0, 0, 0.5, 0], [0, 0, 0.3, 0], [0, 0, 0.5, 0]], float),
        edges=np.array([[NO_EDGE, CORNER], [CORNER, CORNER], [NO_EDGE, NO_EDGE]], np.int8),
    )
    assert view.landmarks().tolist() == [True, False, False]


def test_readings_beyond_the_range_are_dropped() -> None:
    walls = [[6.0, -3.0, 6.0, 3.0]]
    assert len(view_of(walls, max_range=5.0).surfaces) == 0
    assert len(view_of(walls, max_range=7.5).surfaces) == 1


def test_nothing_seen_is_an_empty_view() -> None:
    scan = LaserScan(ranges=np.full(181, np.inf), geometry=LaserGeometry())
    assert construct_view(scan).surfaces.shape == (0, 4)


def test_one_lonely_beam_is_no_surface() -> None:
    ranges = np.full(181, np.inf)
    ranges[90] = 2.0
    scan = LaserScan(ranges=ranges, geometry=LaserGeometry())
    assert construct_view(scan).surfaces.shape == (0, 4)


@pytest.mark.parametrize("fit", [False, True])
def test_every_surface_lies_on_a_wall(fit: bool) -> None:
    pose = np.array([-2.0, -1.0, 0.4])
    view = construct_view(scan_from(pose, ROOM), ViewConfig(fit_lines=fit))
    placed = transform_segments(pose, view.surfaces)
    assert len(placed) >= 8
    for x1, y1, x2, y2 in placed:
        for share in (0.1, 0.5, 0.9):
            point = np.array([x1 + share * (x2 - x1), y1 + share * (y2 - y1)])
            assert distance_to(ROOM, point) < 0.11


def distance_to(walls: np.ndarray, point: np.ndarray) -> float:
    start, run = walls[:, :2], walls[:, 2:] - walls[:, :2]
    along = np.clip(((point - start) * run).sum(1) / (run**2).sum(1), 0, 1)
    return float(np.hypot(*(start + along[:, None] * run - point).T).min())


@settings(deadline=None, max_examples=25)
@given(
    st.tuples(st.floats(-3, 2), st.floats(-2, 2), st.floats(-3, 3)).map(np.array),
    st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)).map(np.array),
)
def test_moving_the_whole_scene_leaves_the_view(pose: np.ndarray, motion: np.ndarray) -> None:
    config = ViewConfig(fit_lines=True)
    here = construct_view(scan_from(pose, ROOM), config)
    there_scan = scan_from(compose(motion, pose), transform_segments(motion, ROOM))
    there = construct_view(there_scan, config)
    # A beam that grazes an edge may fall on either side of it: compare like with like.
    if np.allclose(there_scan.ranges, scan_from(pose, ROOM).ranges, atol=1e-6):
        assert here.surfaces.shape == there.surfaces.shape
        assert np.allclose(here.surfaces, there.surfaces, atol=1e-4)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(0.05, 40.0), min_size=2, max_size=60))
def test_any_ranges_give_a_sound_view(ranges: list[float]) -> None:
    geometry = LaserGeometry(beams=len(ranges))
    view = construct_view(
        LaserScan(ranges=np.array(ranges), geometry=geometry), ViewConfig(fit_lines=True)
    )
    assert np.isfinite(view.surfaces).all()
    run = view.surfaces[:, 2:] - view.surfaces[:, :2]
    assert (np.hypot(run[:, 0], run[:, 1]) >= 0.10).all()
    assert view.edges.shape == (len(view.surfaces), 2)


@pytest.mark.parametrize("name", ["max_range", "cluster_gap", "break_height"])
def test_thresholds_must_be_lengths(name: str) -> None:
    with pytest.raises(InputError, match=name):
        ViewConfig(**{name: float("nan")})
