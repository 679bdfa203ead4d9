"""Breadcrumbs: where the robot has been, and the way home along them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString, box

from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.wayfinding import waypoint_home
from albot_core.mappers.albot1.trail.breadcrumbs import Breadcrumbs
from albot_core.mappers.albot1.trail.crumb_kernels import (
    CLEARANCE,
    MAX_CRUMBS,
    SAME_CRUMB,
    VIEW_RANGE,
    find_reachable,
)

NOTHING = np.empty((0, 4))


def _walk(breadcrumbs: Breadcrumbs, *points: tuple[float, float], place: int = 0) -> None:
    """Drop breadcrumbs one after another, looking where the last step led."""
    before = breadcrumbs.points[breadcrumbs.last] if breadcrumbs.last >= 0 else np.zeros(2)
    for point in points:
        to = np.array(point) - before
        breadcrumbs.drop(place, np.array((*point, np.arctan2(to[1], to[0]))), NOTHING)
        before = np.array(point)


def _begun() -> Breadcrumbs:
    breadcrumbs = Breadcrumbs()
    breadcrumbs.drop(0, np.zeros(3), NOTHING)
    return breadcrumbs


def test_the_way_home_is_the_way_that_it_came() -> None:
    breadcrumbs = _begun()
    _walk(breadcrumbs, *((0.5 * k, 0.0) for k in range(1, 9)))
    away = np.full(9, np.inf)
    away[8] = 0.1
    assert breadcrumbs.path_home(away).points == list(range(8, -1, -1))


def test_old_breadcrumbs_are_used_again() -> None:
    breadcrumbs = _begun()
    _walk(breadcrumbs, (1.0, 0.0), (2.0, 0.0), (1.1, 0.1), (0.1, 0.0))
    assert len(breadcrumbs.points) == 3
    assert breadcrumbs.last == 0


def test_points_of_two_places_are_never_one() -> None:
    breadcrumbs = _begun()
    breadcrumbs.drop(1, np.array((0.1, 0.0, 0.0)), NOTHING)
    assert breadcrumbs.places.tolist() == [0, 1]


def test_a_point_in_view_cuts_a_long_way_short() -> None:
    """It goes round a corner; then it turns and sees where it set out, with nothing between."""
    breadcrumbs = _begun()
    _walk(breadcrumbs, (0.0, 1.0), (0.0, 2.0), (1.0, 2.0), (2.0, 2.0))
    away = np.full(5, np.inf)
    away[4] = 0.0
    assert breadcrumbs.path_home(away).points == [4, 3, 2, 1, 0]
    facing_home = np.array((2.0, 2.0, -0.75 * np.pi))
    breadcrumbs.drop(0, facing_home, NOTHING)
    assert breadcrumbs.path_home(away).points == [4, 3, 2, 1, 0], (
        "there may be a wall too small to be seen"
    )
    breadcrumbs.drop(0, facing_home, np.array(((4.0, -1.0, 4.0, 1.0),)))
    assert breadcrumbs.path_home(away).points == [4, 0]


def test_a_wall_between_bars_the_short_cut() -> None:
    breadcrumbs = _begun()
    _walk(breadcrumbs, (0.0, 1.0), (0.0, 2.0), (1.0, 2.0), (2.0, 2.0))
    wall = np.array(((1.0, -3.0, 1.0, 3.0),))  # a metre ahead of it, right across
    nearby = breadcrumbs.nearby(0, np.array((2.0, 2.0, -0.75 * np.pi)), wall)
    assert not nearby.reachable[:3].any()
    assert nearby.reachable[4]


@given(
    st.lists(st.tuples(*[st.floats(-9, 9)] * 4), max_size=4),
    st.lists(st.tuples(*[st.floats(-9, 9)] * 2), min_size=1, max_size=6),
)
def test_a_point_is_in_view_where_the_strip_to_it_is_clear_and_a_wall_is_seen_beyond(
    walls: list[tuple[float, ...]], points: list[tuple[float, float]]
) -> None:
    """The slow way: shapely's intersections, in a frame that looks along the strip."""
    view, where = np.array(walls, float).reshape(-1, 4), np.array(points)
    distances, reachable = np.empty(len(where)), np.empty(len(where), np.bool_)
    find_reachable(where, np.ones(len(where), np.int64), 0, np.zeros(3), view, distances, reachable)
    for k, (x, y) in enumerate(points):
        length = np.hypot(x, y)
        if length < SAME_CRUMB or x <= 0 or length >= VIEW_RANGE:
            assert reachable[k] == (length < SAME_CRUMB)
            continue
        along = transform_segments(np.array((0.0, 0.0, -np.arctan2(y, x))), view)
        lines = [LineString([wall[:2], wall[2:]]) for wall in along]
        # Walls that all but touch the strip may be told either way.
        wide = box(-1e-6, -CLEARANCE - 1e-6, length + CLEARANCE + 1e-6, CLEARANCE + 1e-6)
        narrow = box(1e-6, -CLEARANCE + 1e-6, length + CLEARANCE - 1e-6, CLEARANCE - 1e-6)
        beyond = box(length + CLEARANCE, -CLEARANCE + 1e-6, 99.0, CLEARANCE - 1e-6)
        nearby = box(length + CLEARANCE, -CLEARANCE - 1e-6, 99.0, CLEARANCE + 1e-6)
        if not any(line.intersects(wide) for line in lines):
            assert reachable[k] or not any(line.intersects(beyond) for line in lines)
        if any(line.intersects(narrow) for line in lines):
            assert not reachable[k]
        if not any(line.intersects(nearby) for line in lines):
            assert not reachable[k]


def test_points_move_with_their_place() -> None:
    breadcrumbs = _begun()
    breadcrumbs.drop(1, np.array((3.0, 0.0, 0.0)), NOTHING)
    breadcrumbs.move(breadcrumbs.places == 1, np.array((0.0, 1.0, np.pi / 2)), 0)
    np.testing.assert_allclose(breadcrumbs.points, [[0, 0], [0, 4]], atol=1e-12)
    assert breadcrumbs.places.tolist() == [0, 0]


def test_of_too_many_breadcrumbs_the_oldest_side_ways_are_forgotten() -> None:
    """East along a corridor with a side way, back, and far to the west."""
    breadcrumbs = _begun()
    side = [(5.0, 0.5 * k) for k in range(1, 600)]
    out = [(0.5 * k, 0.0) for k in range(1, 11)]
    west = [(-0.5 * k, 0.0) for k in range(1, MAX_CRUMBS - 500)]
    _walk(breadcrumbs, *out, *side, *side[::-1], *out[::-1], (0.0, 0.0), *west)
    assert MAX_CRUMBS // 2 <= len(breadcrumbs.points) < MAX_CRUMBS
    np.testing.assert_array_equal(breadcrumbs.points[0], (0.0, 0.0))
    np.testing.assert_array_equal(breadcrumbs.points[breadcrumbs.last], west[-1])
    # Of the side way its end was trodden on longest ago, but the rest is on no way home.
    assert breadcrumbs.points[:, 1].max() < side[-1][1]
    here = np.where(np.arange(len(breadcrumbs.points)) == breadcrumbs.last, 0.0, np.inf)
    way = breadcrumbs.path_home(here)
    assert way.length == pytest.approx(-west[-1][0])
    assert [tuple(breadcrumbs.points[k]) for k in way.points] == [*west[::-1], (0.0, 0.0)]


def test_the_way_home_is_never_forgotten_however_long() -> None:
    breadcrumbs = _begun()
    _walk(breadcrumbs, *((0.5 * k, 0.0) for k in range(1, MAX_CRUMBS + 200)))
    assert len(breadcrumbs.points) == MAX_CRUMBS + 200
    assert breadcrumbs.tree.distances[-1] == pytest.approx(0.5 * (MAX_CRUMBS + 199))


@pytest.mark.parametrize("map_to_graph", [(0.0, 0.0, 0.0), (2.0, -1.0, 0.5)])
def test_the_waypoint_is_ahead_on_the_way_and_none_near_home(
    map_to_graph: tuple[float, float, float],
) -> None:
    network = PlaceNetwork(PlacesConfig.thesis())
    network.map_to_graph = np.array(map_to_graph)
    for k in range(1, 13):
        pose = compose(network.map_to_graph, np.array((0.5 * k, 0.0, 0.0)))
        network.drop_breadcrumb(pose, NOTHING)
    ahead, length = waypoint_home(network, pose, NOTHING)
    assert length == pytest.approx(6.0)
    expected = transform_points(network.map_to_graph, np.array((4.0, 0.0)))
    np.testing.assert_allclose(ahead, expected, atol=1e-9)
    near = compose(network.map_to_graph, np.array((0.5, 0.0, 0.0)))
    nothing, length = waypoint_home(network, near, NOTHING)
    assert np.isnan(nothing).all()
    assert length == pytest.approx(0.5)
