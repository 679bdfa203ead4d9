"""The frame of reference: landmarks and motions found in small scenes whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import inverse, relative, transform_segments, wrap_angle
from albot_core.mappers.association import landmarks as compiled
from albot_core.mappers.association.surfaces import Surfaces

ANGLE, CLOSENESS = np.radians(10.0), 0.4
SIGMA = ANGLE / 2
VIEW = np.array(
    ((-2.0, -3, 6, -3), (6, -2.5, 6, 1), (6, 3, 2, 3), (1, 4, -3, 4), (-3, 1, -3, -1), (3, 0, 4, 1))
)
"""Five walls of a room, and a surface aslant (m)."""


def landmarks(previous: list[tuple[float, ...]], current: list[tuple[float, ...]]) -> list[int]:
    matched = np.empty(len(current), np.int64)
    arrays = np.array(previous, float), np.array(current, float)
    count = compiled.find_landmarks(*arrays, ANGLE, CLOSENESS, matched)
    assert count == (matched >= 0).sum()
    return matched.tolist()


def test_close_surfaces_of_the_same_orientation_are_landmarks():
    wall = (0.0, 2.0, 4.0, 2.0)
    assert landmarks([wall], [(1, 2.3, 6, 2.3), (1, 2.5, 6, 2.5)]) == [0, -1]
    tan = np.tan(np.radians((9.0, 11.0)))
    assert landmarks([wall], [(1, 2, 5, 2 + 4 * tan[0])]) == [0]
    assert landmarks([wall], [(1, 2, 5, 2 + 4 * tan[1])]) == [-1]


def test_the_other_face_of_a_wall_is_another_surface():
    assert landmarks([(0, 2, 4, 2)], [(4, 2.15, 0, 2.15)]) == [-1]


def test_of_several_the_most_similar_orientation_is_chosen_and_each_is_one_landmark():
    previous = [(0, 2, 4, 2), (0, 2, 4, 2.4)]
    assert landmarks(previous, [(0.5, 2.05, 3.5, 2.35)]) == [1]
    assert landmarks([(0, 2, 4, 2)], [(0, 2, 1.5, 2.1), (2, 2, 4, 2)]) == [-1, 0]


def lengths_of(surfaces: np.ndarray) -> np.ndarray:
    return np.hypot(*(surfaces[:, 2:] - surfaces[:, :2]).T)


def identify(
    view: np.ndarray, current: np.ndarray, expected: np.ndarray, sigma: float = SIGMA
) -> tuple[np.ndarray, list[int], float]:
    """The motion, the previous view's number of each current surface, and the turn's deviation."""
    motion, matched = np.empty(3), np.empty(len(current), np.int64)
    views = Surfaces(view, lengths_of(view)), Surfaces(current, lengths_of(current))
    believed = compiled.ExpectedMotion(expected, sigma, 0.5 * CLOSENESS)
    found = compiled.identify_landmarks(*views, believed, ANGLE, CLOSENESS, motion, matched)
    return motion, matched.tolist(), found


@given(
    st.floats(-1.5, 1.5),
    st.floats(-0.5, 0.5),
    st.floats(-0.6, 0.6),
    st.floats(-0.15, 0.15),
    st.floats(-0.14, 0.14),
)
def test_the_motion_is_found_by_landmarks_whatever_the_odometer_says(x, y, turn, wrong, off):
    true = np.array((x, y, turn))
    current = transform_segments(inverse(true), VIEW)
    motion, matched, sigma = identify(VIEW, current, true + np.array((wrong, -wrong, off)))
    assert matched == list(range(len(VIEW)))
    np.testing.assert_allclose(motion, true, atol=0.02)
    assert sigma < np.radians(0.5)


@pytest.mark.parametrize("off", [-30.0, -17.0, 13.0, 25.0])
def test_a_turn_that_was_measured_very_wrong_is_found_where_the_odometer_is_known_to_be_bad(off):
    true = np.array((1.0, 0.1, 0.3))
    current = transform_segments(inverse(true), VIEW)
    expected = true + np.array((0, 0, np.radians(off)))
    motion, matched, _ = identify(VIEW, current, expected, sigma=np.radians(10.0))
    assert matched == list(range(len(VIEW)))
    np.testing.assert_allclose(motion, true, atol=0.02)


@pytest.mark.parametrize("sigma", [1e-3, 1e150])
def test_the_largest_and_the_least_deviation_of_a_turn_are_allowed(sigma):
    motion, matched, _ = identify(VIEW, VIEW, np.zeros(3), sigma=sigma)
    assert matched == list(range(len(VIEW)))
    np.testing.assert_allclose(motion, 0.0, atol=1e-6)


def test_a_surface_that_moved_is_no_landmark():
    """A door, say; by the odometer alone it would be close enough and of the same orientation."""
    current = VIEW.copy()
    current[1, ::2] += 0.35
    motion, matched, _ = identify(VIEW, current, np.zeros(3))
    assert matched == [0, -1, 2, 3, 4, 5]
    np.testing.assert_allclose(motion, 0.0, atol=0.01)


def test_along_a_corridor_the_odometer_tells_how_far():
    walls = np.array(((-9.0, -1, 9, -1), (9, 1, -9, 1)))
    true, expected = np.array((1.0, 0, 0)), np.array((0.8, 0.1, 0.1))
    motion, matched, _ = identify(walls, transform_segments(inverse(true), walls), expected)
    assert matched == [0, 1]
    np.testing.assert_allclose(motion, (0.8, 0.0, 0.0), atol=0.01)


def test_without_landmarks_the_motion_is_the_expected_one():
    expected = np.array((1.0, 0.2, 0.1))
    for current in (np.empty((0, 4)), VIEW + 50.0):
        motion, matched, sigma = identify(VIEW, current, expected)
        assert matched == [-1] * len(current)
        np.testing.assert_array_equal(motion, expected)
        assert sigma == SIGMA
    motion, _, _ = identify(np.empty((0, 4)), VIEW, expected)
    np.testing.assert_array_equal(motion, expected)


def fitted(seen: np.ndarray, known: np.ndarray, slack: np.ndarray) -> tuple[np.ndarray, float]:
    """The pose by surfaces that are all known, expected at the origin, and its deviation."""
    pose, partner = np.empty(3), np.arange(len(seen))
    both = Surfaces(seen, lengths_of(seen)), Surfaces(known, lengths_of(known))
    expected = compiled.ExpectedMotion(np.zeros(3), SIGMA, 0.2)
    return pose, compiled.fit_pose(*both, partner, expected, 0.0, slack, pose)


def test_directions_count_by_the_inverse_of_their_variance():
    """One wall: between what it says, and the expected direction."""
    wall, turned = np.array(((-1.0, 0, 1, 0),)), np.radians(1.0)
    known = transform_segments(np.array((0, 0, turned)), wall)
    pose, sigma = fitted(wall, known, np.zeros(1))
    variance, _ = compiled.variances(2.0, 2.0)
    assert sigma == pytest.approx((1 / SIGMA**2 + 1 / variance) ** -0.5, rel=0.05)
    assert pose[2] == pytest.approx(turned / (1 + variance / SIGMA**2), rel=0.05)


def test_the_shorter_a_surface_the_less_it_tells():
    variances = [compiled.variances(length, 5.0) for length in (0.5, 1.0, 3.0, 5.0)]
    assert (np.diff(variances, axis=0) < 0).all()


def test_of_two_walls_that_contradict_each_other_the_one_with_less_slack_counts():
    seen = np.array(((-2.0, -1, 2, -1), (2, 1, -2, 1)))
    known = seen + np.array(((0, 0.1, 0, 0.1), (0, -0.1, 0, -0.1)))
    pose, _ = fitted(seen, known, np.array((0.0, 0.2)))
    np.testing.assert_allclose(pose, (0.0, 0.1, 0.0), atol=0.02)


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3.1, 3.1))
def test_a_fit_does_not_depend_on_the_frame(x, y, turn):
    frame, true = np.array((x, y, turn)), np.array((0.1, -0.05, 0.02))
    known = transform_segments(frame, transform_segments(true, VIEW))
    pose, partner = np.empty(3), np.arange(len(VIEW))
    both = Surfaces(VIEW, lengths_of(VIEW)), Surfaces(known, lengths_of(known))
    expected = compiled.ExpectedMotion(frame, SIGMA, 0.2)
    compiled.fit_pose(*both, partner, expected, 0.0, np.zeros(len(VIEW)), pose)
    found = relative(frame, pose)
    np.testing.assert_allclose(found[:2], true[:2], atol=0.01)
    assert abs(wrap_angle(found[2] - true[2])) < 0.002
