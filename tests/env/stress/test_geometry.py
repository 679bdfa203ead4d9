"""The plain geometry against shapely, and against closed forms."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from albot_env.stress.geometry import (
    depths_in,
    nearest_in_cones,
    ray_ranges,
    wall_distances,
    walls_crossed,
)

BOX = np.array([[0.0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]])


def any_walls(seed: int, count: int = 30) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-5, 5, (count, 4))


def lines(walls: np.ndarray) -> np.ndarray:
    return shapely.linestrings(walls.reshape(-1, 2, 2))


def test_ways_in_a_box():
    bearings = np.radians((-90.0, 0.0, 45.0, 90.0, 180.0))
    ways = ray_ranges(BOX, np.array((1.0, 1.0, 0.0)), bearings)
    assert np.allclose(ways, (1, 3, 2 * np.sqrt(2), 2, 1))


def test_a_beam_that_meets_nothing_goes_on_for_ever():
    assert ray_ranges(BOX[:1], np.array((1.0, 1.0, 0.0)), np.array((np.pi / 2,)))[0] == np.inf


def test_a_beam_goes_on_for_ever_where_there_are_no_walls():
    ways = ray_ranges(np.empty((0, 4)), np.zeros(3), np.array((0.0, 1.0)))
    assert ways.tolist() == [np.inf, np.inf]


def test_a_corner_lets_no_beam_through():
    pose = np.array((1.0, 1.0, np.arctan2(2, 3)))
    for turn in (-1e-4, 0.0, 1e-4):
        assert abs(ray_ranges(BOX, pose, np.array((turn,)))[0] - np.sqrt(13)) < 1e-3


@given(st.integers(0, 2**32 - 1))
def test_ways_are_shapelys(seed: int):
    walls, rng = any_walls(seed), np.random.default_rng((seed, 1))
    pose = np.append(rng.uniform(-5, 5, 2), rng.uniform(-4, 4))
    bearings = rng.uniform(-2, 2, 20)
    tips = pose[:2] + 30 * np.stack((np.cos(pose[2] + bearings), np.sin(pose[2] + bearings)), 1)
    beams = shapely.linestrings(np.stack((np.broadcast_to(pose[:2], tips.shape), tips), axis=1))
    met = shapely.intersection(beams[:, None], lines(walls)[None])
    expected = shapely.distance(met, shapely.Point(pose[:2]))
    expected = np.where(np.isnan(expected), np.inf, expected).min(axis=1)
    assert np.allclose(ray_ranges(walls, pose, bearings), expected, atol=1e-7)


@given(st.integers(0, 2**32 - 1))
def test_depths_in_a_polygon_are_those_of_the_deepest_of_many_points(seed: int):
    walls, rng = any_walls(seed), np.random.default_rng((seed, 1))
    angles = np.sort(rng.uniform(0, 2 * np.pi, 5))
    corners = 3 * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    shares = np.linspace(0, 1, 200)[:, np.newaxis, np.newaxis]
    points = shapely.points(walls[:, :2] + shares * (walls[:, 2:] - walls[:, :2]))
    polygon = shapely.Polygon(corners)
    inside = shapely.contains(polygon, points)
    expected = np.where(inside, shapely.distance(points, polygon.exterior), 0.0).max(axis=0)
    assert np.allclose(np.maximum(depths_in(walls, corners), 0.0), expected, atol=0.03)


@given(st.integers(0, 2**32 - 1))
def test_distances_and_crossings_are_shapelys(seed: int):
    walls, rng = any_walls(seed), np.random.default_rng((seed, 1))
    before, after = rng.uniform(-5, 5, (2, 2))
    expected = shapely.distance(lines(walls), shapely.Point(before))
    assert np.allclose(wall_distances(walls, before), expected)
    way = shapely.LineString((before, after))
    assert np.array_equal(walls_crossed(walls, before, after), shapely.crosses(lines(walls), way))


def test_standing_still_crosses_nothing():
    point = np.array((2.0, 1e-9))
    assert not walls_crossed(BOX, point, point).any()


@given(st.integers(0, 2**32 - 1))
def test_the_nearest_in_a_cone_is_shapelys(seed: int):
    rng = np.random.default_rng((seed, 2))
    walls, half = any_walls(seed, 8), rng.uniform(0.1, 1.4)
    ears = np.column_stack((rng.uniform(-5, 5, (3, 2)), rng.uniform(-4, 4, 3)))
    edges = ears[:, 2:] + np.array((-half, half))
    far = ears[:, None, :2] + 1e3 * np.stack((np.cos(edges), np.sin(edges)), axis=-1)
    cones = shapely.polygons(np.concatenate((ears[:, None, :2], far), axis=1))
    inside = shapely.intersection(cones[:, None], lines(walls)[None])
    found = shapely.distance(inside, shapely.points(ears[:, None, :2]))
    expected = np.where(np.isnan(found), np.inf, found).min(axis=1)
    assert np.allclose(nearest_in_cones(walls, ears, half), expected, atol=1e-6)


def test_no_surface_is_nearest_where_there_is_none():
    ears = np.array([[1.0, 1.0, 0.0]])
    assert nearest_in_cones(np.empty((0, 4)), ears, 0.3)[0] == np.inf
    assert nearest_in_cones(BOX[3:], ears, 0.3)[0] == np.inf
    assert nearest_in_cones(BOX[1:2], ears, 0.3)[0] == 3.0
