"""Map entropy: closed forms, and that smearing and doubling raise it."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from albot_core.errors import InputError
from albot_core.evaluation.map_quality import (
    LASER_NOISE,
    MIN_NEIGHBOURS,
    cloud_error,
    mean_map_entropy,
    precision_and_recall,
    sample_segments,
    scan_cloud,
    surface_distances,
    surface_error,
)
from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.sensing.reading import LaserGeometry, LaserScan

ROOM = np.array([[0.0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0]])
HERE = np.zeros(3)
POSE = hnp.arrays(np.float64, 3, elements=st.floats(-5, 5, allow_subnormal=False))
SEGMENTS = st.integers(1, 6).flatmap(
    lambda n: hnp.arrays(np.float64, (n, 4), elements=st.floats(-9, 9, allow_subnormal=False))
)


def test_true_walls_have_no_error():
    assert surface_error(ROOM, ROOM, HERE) == pytest.approx(0, abs=1e-12)


def test_a_surface_beside_its_wall():
    beside = np.array([[1.0, 0.3, 5, 0.3]])
    assert surface_error(beside, ROOM, HERE) == pytest.approx(0.3)


def test_a_surface_counts_by_its_length():
    # Six metres on the wall outweigh five short pieces that are a metre off.
    long = np.array([[0.0, 0, 6, 0]])
    short = np.array([[1.0 + k, 1, 1.1 + k, 1] for k in range(5)])
    assert surface_error(np.concatenate((long, short)), ROOM, HERE) == pytest.approx(0, abs=1e-12)


@settings(deadline=None)
@given(surfaces=SEGMENTS, frame=POSE)
def test_the_error_goes_with_the_frame(surfaces, frame):
    plain = surface_error(surfaces, ROOM, HERE)
    in_map = transform_segments(inverse(frame), surfaces)
    assert surface_error(in_map, ROOM, frame) == pytest.approx(plain, abs=1e-6)


@settings(deadline=None)
@given(surfaces=SEGMENTS)
def test_distances_are_shapelys(surfaces):
    distances = surface_distances(surfaces, ROOM, HERE, spacing=0.5)
    walls = shapely.multilinestrings(shapely.linestrings(ROOM.reshape(-1, 2, 2)))
    points = shapely.points(sample_segments(surfaces, 0.5))
    np.testing.assert_allclose(distances, shapely.distance(points, walls), atol=1e-9)


@settings(deadline=None)
@given(segments=SEGMENTS, spacing=st.floats(0.05, 3))
def test_samples_lie_on_their_segment_evenly(segments, spacing):
    for segment in segments:
        points = sample_segments(segment[None], spacing)
        length = float(np.hypot(*(segment[2:] - segment[:2])))
        assert len(points) == max(int(np.ceil(length / spacing - 1e-6)), 1)
        np.testing.assert_allclose(points.mean(axis=0), (segment[:2] + segment[2:]) / 2, atol=1e-9)
        gaps = np.hypot(*np.diff(points, axis=0).T)
        assert (gaps <= spacing * (1 + 1e-5)).all()
    assert len(sample_segments(segments, spacing)) == sum(
        len(sample_segments(segment[None], spacing)) for segment in segments
    )


def test_nothing_to_measure():
    assert surface_error(np.empty((0, 4)), ROOM, HERE) is None
    with pytest.raises(InputError, match="at least one wall"):
        surface_error(ROOM, np.empty((0, 4)), HERE)
    with pytest.raises(InputError, match="a positive length"):
        surface_error(ROOM, ROOM, HERE, spacing=0.0)


def test_a_cloud_stands_for_the_walls_that_it_samples() -> None:
    wall = np.array([[0.0, 0.0, 4.0, 0.0]])
    cloud = sample_segments(wall, 0.01)
    beside = wall + np.array([0.0, 0.25, 0.0, 0.25])
    assert cloud_error(beside, cloud, np.zeros(3)) == pytest.approx(0.25, abs=1e-3)
    assert cloud_error(beside, cloud, np.array([0.0, -0.25, 0.0])) == pytest.approx(0.0, abs=1e-2)
    assert cloud_error(np.empty((0, 4)), cloud, np.zeros(3)) is None
    with pytest.raises(InputError, match="at least one point"):
        cloud_error(wall, np.empty((0, 2)), np.zeros(3))


def test_precision_is_of_the_map_and_recall_of_what_was_seen() -> None:
    """Of a wall of 4 m the half was seen; the map has a quarter of it, and as much elsewhere."""
    wall = sample_segments(np.array([[0.0, 0.0, 4.0, 0.0]]), 0.01)
    right, wrong = wall[wall[:, 0] < 1.0], wall[wall[:, 0] < 1.0] + (0.0, 2.0)
    drawn, seen = np.concatenate((right, wrong)), wall[wall[:, 0] < 2.0]
    assert precision_and_recall(drawn, wall, seen, 1e-3) == (0.5, 0.5)
    assert precision_and_recall(drawn, wall, wall, 1e-3) == (0.5, 0.25)
    assert precision_and_recall(np.empty((0, 2)), wall, seen, 0.1) == (0.0, 0.0)


@pytest.mark.parametrize(("walls", "seen"), [(0, 0), (0, 3), (3, 0)])
def test_without_walls_or_without_any_seen_there_is_no_recall(walls: int, seen: int) -> None:
    with pytest.raises(InputError, match=f"walls, and some seen, found {walls}, {seen} seen"):
        precision_and_recall(np.zeros((1, 2)), np.zeros((walls, 2)), np.zeros((seen, 2)), 0.1)


RNG = np.random.default_rng(5)
WALL = np.stack((np.linspace(0, 8, 1600), np.zeros(1600)), axis=-1)


def test_a_normal_cloud_has_the_entropy_of_the_normal_distribution() -> None:
    spread = 0.02
    cloud = RNG.normal(0.0, spread, (3000, 2))
    expected = np.log(2 * np.pi * np.e * (spread**2 + LASER_NOISE**2))
    assert mean_map_entropy(cloud, radius=1.0) == pytest.approx(expected, abs=0.05)


def test_a_straight_wall_is_a_box_of_the_radius_and_the_smear() -> None:
    # Neighbours lie evenly on 0.6 m, but for those at the wall's two ends.
    expected = np.log(2 * np.pi * np.e * np.sqrt(0.3**2 / 3 + LASER_NOISE**2) * LASER_NOISE)
    assert mean_map_entropy(WALL, radius=0.3) == pytest.approx(expected, abs=0.05)


def test_smeared_and_doubled_walls_are_less_crisp() -> None:
    once = mean_map_entropy(WALL)
    smeared = mean_map_entropy(WALL + RNG.normal(0.0, 0.05, WALL.shape))
    doubled = mean_map_entropy(np.concatenate((WALL, WALL + np.array([0.0, 0.2]))))
    assert once is not None
    assert smeared is not None
    assert doubled is not None
    assert smeared > once + 0.5
    assert doubled > once + 1.0


def test_a_neighbourhoods_covariance_is_numpys() -> None:
    cloud = np.round(np.random.default_rng(2).uniform(0, 4, (900, 2)), 2)  # Some lie twice.
    entropies = []
    for centre in cloud[::2]:
        near = cloud[np.hypot(*(cloud - centre).T) <= 0.2]
        if len(near) >= MIN_NEIGHBOURS:
            covariance = np.cov(near.T) + LASER_NOISE**2 * np.eye(2)
            entropies.append(0.5 * np.log(np.linalg.det(2 * np.pi * np.e * covariance)))
    assert 256 < len(entropies) < 450  # Some are too lonely.
    assert mean_map_entropy(cloud, 0.2, samples=450) == pytest.approx(np.mean(entropies), abs=1e-9)


@settings(deadline=None, max_examples=20)
@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)).map(np.array))
def test_moving_the_map_changes_nothing(motion: np.ndarray) -> None:
    cloud = np.random.default_rng(0).normal(0.0, 0.3, (500, 2))
    moved = mean_map_entropy(transform_points(motion, cloud))
    assert moved == pytest.approx(mean_map_entropy(cloud), abs=1e-6)


def test_nothing_and_loneliness_have_no_entropy() -> None:
    assert mean_map_entropy(np.empty((0, 2))) is None
    assert mean_map_entropy(np.arange(20.0).reshape(-1, 2) * 10) is None


def test_the_radius_must_be_a_length() -> None:
    with pytest.raises(InputError, match="radius"):
        mean_map_entropy(WALL, radius=float("nan"))


def test_scans_are_laid_where_the_poses_say_and_thinned() -> None:
    geometry = LaserGeometry(beams=2, first_bearing=0.0, spacing=np.pi / 2)
    scan = LaserScan(ranges=np.array([1.0, np.inf]), geometry=geometry)
    poses = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, np.pi / 2]])
    assert np.allclose(scan_cloud([scan, scan], poses), [[1.0, 0.0], [5.0, 1.0]])
    assert len(scan_cloud([scan] * 10, np.zeros((10, 3)), most=4)) <= 4
    assert scan_cloud([], np.empty((0, 3))).shape == (0, 2)


# An L of two rooms, with a niche: no turn and no mirror image lays it on itself.
