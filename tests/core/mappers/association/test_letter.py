"""Landmark association to the letter: matches, normalising and transfers in small scenes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.mappers.association import paper
from albot_core.mappers.association.global_map import UNKNOWN
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from tests.core.mappers.association.test_mapper import HOUSE, WAY, readings, unlike
from tests.core.scenes import scan_from

ANGLE, CLOSENESS = np.radians(10.0), 0.4


def matches(previous: list[tuple[float, ...]], current: list[tuple[float, ...]]) -> list[int]:
    matched = np.empty(len(current), np.int64)
    arrays = np.array(current, float), np.array(previous, float)
    paper.match_views(*arrays, ANGLE, CLOSENESS, matched)
    return matched.tolist()


def transferred(
    view: list[tuple[float, ...]],
    landmarks: list[int],
    known: list[tuple[float, ...]],
    expected: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[np.ndarray, list[int], np.ndarray]:
    """The map, the IDs and the robot's pose after a transfer."""
    surfaces = np.full((len(known) + len(view), 4), np.nan)
    surfaces[: len(known)] = np.reshape(known, (-1, 4))
    ids, pose = np.array(landmarks), np.empty(3)
    count = paper.transfer(
        np.array(view, float), np.array(landmarks), np.array(expected), (ANGLE, CLOSENESS),
        surfaces, len(known), ids, pose,
    )  # fmt: skip
    return surfaces[:count], ids.tolist(), pose


def test_of_the_close_surfaces_the_most_similar_orientation_is_the_landmark():
    near_but_turned, far_but_parallel = (0.0, 2.05, 4.0, 2.4), (0.0, 2.38, 4.0, 2.38)
    assert matches([near_but_turned, far_but_parallel], [(0, 2, 4, 2)]) == [1]
    assert matches([(0, 2.42, 4, 2.42)], [(0, 2, 4, 2)]) == [-1]
    assert matches([(1.0, 0, 4, 3)], [(0, 0, 3, 3)]) == [-1]  # Side by side, aslant.
    tan = np.tan(np.radians((9.5, 10.5)))
    for rise, match in zip(4 * tan, (0, -1), strict=True):
        assert matches([(0, 2, 4, 2 + rise)], [(0, 2, 4, 2)]) == [match]


def test_a_surface_is_transferred_by_its_nearest_landmark_alone():
    """Two landmarks disagree by 1 m and 5°: the new surface goes where the nearer one says."""
    view = [(0.0, 2, 4, 2), (10.0, 2, 14, 2), (9.0, -1, 9, 1), (1, -1, 1, 1)]
    turn = np.radians(5.0)
    moved = transform_segments(np.array((0.0, 1.0, turn)), np.array(view[1:2]))[0]
    surfaces, ids, pose = transferred(view, [0, 1, UNKNOWN, UNKNOWN], [view[0], tuple(moved)])
    assert ids == [0, 1, 2, 3]
    by_second = transform_segments(np.array((0.0, 1.0, turn)), np.array(view[2:3]))[0]
    np.testing.assert_allclose(surfaces[2], by_second, atol=1e-12)
    np.testing.assert_allclose(surfaces[3], view[3], atol=1e-12)
    np.testing.assert_allclose(pose, 0.0, atol=1e-12)  # The robot is nearest to the first.


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))
def test_a_transfer_is_the_rigid_motion_of_its_landmark(x, y, turn):
    frame = np.array((x, y, turn))
    view = np.array(((0.0, 2, 4, 2), (1.0, -1, 3, 0.5)))
    known = transform_segments(frame, view[:1])
    surfaces, _, pose = transferred(view.tolist(), [0, UNKNOWN], known.tolist(), (9.0, 9.0, 9.0))
    np.testing.assert_allclose(surfaces[1], transform_segments(frame, view[1:])[0], atol=1e-9)
    np.testing.assert_allclose(pose[:2], frame[:2], atol=1e-9)


def test_what_intersects_is_left_out_and_what_is_close_is_the_same():
    wall, landmark = (3.0, -2, 3, 2), (0.0, 2, 4, 2)
    across, beside, apart = (2.5, 0, 3.5, 0), (3.2, -3, 3.2, 1), (3.6, -2, 3.6, 1.5)
    known = [landmark, wall]
    for surface, expected_id in ((across, UNKNOWN), (beside, 1), (apart, 2)):
        surfaces, ids, _ = transferred([landmark, surface], [0, UNKNOWN], known)
        assert ids == [0, expected_id]
        assert len(surfaces) == max(2, expected_id + 1)
    surfaces, *_ = transferred([landmark, beside], [0, UNKNOWN], known)
    np.testing.assert_allclose(surfaces[1], (3, -3, 3, 2))  # Both get the same length.


def test_without_landmarks_the_odometer_places_all():
    surfaces, ids, pose = transferred([(1, 0, 3, 0)], [UNKNOWN], [], (2.0, 1.0, np.pi / 2))
    assert ids == [0]
    np.testing.assert_allclose(surfaces, [(2, 2, 2, 4)], atol=1e-12)
    np.testing.assert_allclose(pose, (2, 1, np.pi / 2))


def test_with_a_good_odometer_the_map_is_the_house():
    mapper = make_mapper("association-paper")
    for reading in readings(HOUSE, WAY):
        mapper.update(reading)
    assert unlike(mapper, HOUSE, WAY[0]) < 0.1
    np.testing.assert_allclose(compose(WAY[0], mapper.estimate.pose), WAY[-1], atol=0.05)


def test_the_odometer_s_error_of_two_views_is_not_corrected_but_does_not_turn_the_map():
    """The position along a wall is the odometer's; directions are those of the landmarks."""
    wrong = np.array((0.0, 0.0, np.radians(3.0)))
    mapper = make_mapper("association-paper")
    for reading in readings(HOUSE, WAY, error=wrong):
        mapper.update(reading)
    truth = compose(inverse(WAY[0]), WAY[-1])
    assert abs(mapper.estimate.pose[2] - truth[2]) < np.radians(3.0)  # By the odometer: 15°.


@pytest.mark.parametrize("empty_at", [(0,), (3,), (0, 1, 2, 3, 4, 5)])
def test_views_without_surfaces_are_placed_by_the_odometer(empty_at):
    mapper = make_mapper("association-paper")
    for k, reading in enumerate(readings(HOUSE, WAY)):
        nothing = LaserScan(ranges=np.full(181, np.inf), geometry=LaserGeometry())
        laser = nothing if k in empty_at else scan_from(WAY[k], HOUSE)
        mapper.update(Reading(stamp=reading.stamp, motion=reading.motion, laser=laser))
        assert np.isfinite(mapper.estimate.pose).all()
        assert mapper.estimate.localised == (k == 0 or not {k - 1, k} & set(empty_at))
    np.testing.assert_allclose(compose(WAY[0], mapper.estimate.pose), WAY[-1], atol=0.1)
