from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from albot_core.errors import InputError
from albot_core.evaluation.surfaces import (
    cloud_error,
    sample_segments,
    surface_distances,
    surface_error,
)
from albot_core.geometry.poses import inverse, transform_segments

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
