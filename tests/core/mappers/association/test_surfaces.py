"""Surfaces compared, lengthened and carried over: closed forms, and shapely as the oracle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString

from albot_core.mappers.association import surfaces as compiled

ANGLE, CLOSENESS, CORNER = np.radians(10.0), 0.4, 0.2
NUMBERS = st.integers(-400, 400).map(lambda hundredths: hundredths / 100)
SURFACES = (
    st.lists(NUMBERS, min_size=4, max_size=4)
    .map(np.array)
    .filter(lambda ends: np.hypot(*(ends[2:] - ends[:2])) >= 0.5)
)


def line_of(surface: np.ndarray) -> LineString:
    return LineString(surface.reshape(2, 2))


def lengths(surfaces: np.ndarray) -> np.ndarray:
    return np.hypot(*(surfaces[:, 2:] - surfaces[:, :2]).T)


def length_of(surface: np.ndarray) -> float:
    return float(np.hypot(*(surface[2:] - surface[:2])))


@given(SURFACES, SURFACES)
def test_distances_and_crossings_are_those_of_shapely(one, other):
    ours = compiled.distance_between(one, other)
    np.testing.assert_allclose(ours, line_of(one).distance(line_of(other)), atol=1e-9)
    assert compiled.crosses(one, other) == line_of(one).crosses(line_of(other))
    if ours <= 0.3:
        assert compiled.may_be_close(one, other, 0.3)


@given(SURFACES, SURFACES)
def test_a_surface_lengthened_by_an_overhang_reaches_as_far_as_the_other(one, other):
    longer = one.copy()
    compiled.lengthen(longer, *compiled.overhang(one, other))
    np.testing.assert_allclose(compiled.overhang(longer, other), 0.0, atol=1e-9)
    assert length_of(longer) >= length_of(one) - 1e-9


@given(SURFACES, st.floats(-1, 1), st.floats(-ANGLE, ANGLE), st.floats(0.5, 8))
def test_what_is_missing_makes_a_surface_as_long_as_the_known_one(one, aside, turn, length):
    heading = np.arctan2(one[3] - one[1], one[2] - one[0]) + turn
    along = np.array((np.cos(heading), np.sin(heading)))
    first = one[:2] + aside * along[::-1]
    other = np.concatenate((first, first + length * along))
    compiled.lengthen(other, *compiled.overhang(other, one))
    compiled.lengthen(one, *compiled.missing(one, other))
    assert length_of(one) == pytest.approx(length_of(other), abs=1e-9)
    middle, length = compiled.along(one, *(other[:2] + other[2:]) / 2)
    assert middle == pytest.approx(length / 2, abs=1e-9)


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


def test_landmarks_and_the_map_are_normalised_to_one_length():
    # The map is turned by 90° against the view, and the current view runs on beyond both ends.
    previous, current = np.array(((0.0, 2, 4, 2),)), np.array(((-1.0, 2.1, 6, 2.1),))
    known, ids, matched = np.array(((5.0, 0, 5, 4),)), np.array((0,)), np.array((0,))
    compiled.normalise(previous, ids, current, matched, known)
    np.testing.assert_allclose(previous, [(-1, 2, 6, 2)])
    np.testing.assert_allclose(current, [(-1, 2.1, 6, 2.1)])
    np.testing.assert_allclose(known, [(5, -1, 5, 6)])


def carried(
    current: list[tuple[float, ...]], known: list[tuple[float, ...]], landmark: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The view, the map and the IDs, where the view's surface of this number is the map's."""
    seen = np.array(current, float)
    room = np.zeros((len(known) + len(current), 4))
    room[: len(known)] = known
    ids = np.full(len(current), compiled.UNKNOWN)
    matched = ids.copy()
    ids[landmark] = matched[landmark] = 0
    count = compiled.carry_over(
        seen, ids, matched, lengths(seen), np.zeros(3), room, len(known), ANGLE, CLOSENESS, CORNER
    )
    return seen, room[:count], ids


def test_a_new_surface_keeps_its_position_relative_to_the_landmark():
    # The landmark, seen along x, lies along y in the map: the map is turned by 90°.
    _, known, ids = carried([(0, 2, 4, 2), (4, 2, 4, -1)], [(5, 0, 5, 4)], landmark=0)
    np.testing.assert_allclose(known[1], (5, 4, 8, 4), atol=1e-12)
    assert ids.tolist() == [0, 1]


def test_it_is_carried_over_by_the_nearest_landmark():
    seen = np.array(((0.0, 2, 4, 2), (8, 2, 12, 2), (13, 2, 13, 5)))
    ids = np.array((0, 1, -1))
    # In the map the second landmark lies 1 m aside of where the first one says.
    room = np.zeros((3, 4))
    room[:2] = (0, 2, 4, 2), (8, 3, 12, 3)
    count = compiled.carry_over(
        seen, ids.copy(), ids, lengths(seen), np.zeros(3), room, 2, ANGLE, CLOSENESS, CORNER
    )
    assert count == 3
    np.testing.assert_allclose(room[2], (13, 3, 13, 6), atol=1e-12)


def test_along_a_landmark_one_that_crosses_it_tells():
    """The odometer says 0.3 m too little along the corridor, at whose end there is a wall."""
    seen = np.array(((0.0, 2, 9.7, 2), (10, 1, 10, -3), (6, -2, 8, -2)))
    ids = np.array((0, 1, -1))
    room = np.zeros((3, 4))
    room[:2] = (0, 2, 9.7, 2), (10.3, 1, 10.3, -3)
    pose = np.zeros(3)
    count = compiled.carry_over(
        seen, ids.copy(), ids, lengths(seen), pose, room, 2, ANGLE, CLOSENESS, CORNER
    )
    assert count == 3
    np.testing.assert_allclose(room[2], (6.3, -2, 8.3, -2), atol=1e-12)
    np.testing.assert_allclose(pose, (0.3, 0, 0), atol=1e-12)


def test_what_comes_to_lie_close_to_a_known_surface_is_that_one():
    wall = (0, 2, 4, 2)
    seen, known, ids = carried([wall, (1, -3, 5, -3)], [wall, (2, -3.2, 8, -3.2)], landmark=0)
    assert ids.tolist() == [0, 1]
    np.testing.assert_allclose(known, [wall, (1, -3.2, 8, -3.2)])
    np.testing.assert_allclose(seen[1], (1, -3, 8, -3))


def test_what_intersects_a_known_surface_is_left_out():
    wall, across = (0, 2, 4, 2), (6, -3, 6, 3)
    _, known, ids = carried([wall, (5, 0, 8, 0)], [wall, across], landmark=0)
    assert ids.tolist() == [0, compiled.UNKNOWN]
    assert len(known) == 2
    # …but not where it only meets it at a corner.
    _, known, ids = carried([wall, (5.9, 0, 8, 0)], [wall, across], landmark=0)
    assert ids.tolist() == [0, 2]


def test_a_landmark_grows_with_its_surface_in_the_map():
    wall = (0, 2, 4, 2)
    seen, known, ids = carried([wall, (4.2, 2.05, 7, 2.05)], [wall], landmark=0)
    assert ids.tolist() == [0, 0]
    np.testing.assert_allclose(known[0], (0, 2, 7, 2))
    np.testing.assert_allclose(seen[0], (0, 2, 7, 2))
