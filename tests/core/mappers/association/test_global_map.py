"""Surfaces carried over into the global map, in small scenes whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import transform_segments
from albot_core.mappers.association import global_map as compiled
from albot_core.mappers.association.mapper import AssociationConfig
from albot_core.mappers.association.surfaces import Surfaces


def lengths_of(surfaces: np.ndarray) -> np.ndarray:
    return np.hypot(*(surfaces[:, 2:] - surfaces[:, :2]).T)


def carry(
    seen: np.ndarray,
    landmarks: np.ndarray,
    known: np.ndarray,
    expected: tuple[float, ...] = (0.0, 0.0, 0.0),
    **config: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The map, the view, the IDs and the robot's pose, where some of the view are landmarks."""
    room = np.full((len(known) + len(seen), 4), np.nan)
    room[: len(known)] = known
    view, ids, pose = seen.copy(), landmarks.copy(), np.empty(3)
    count = compiled.carry_over(
        Surfaces(seen, lengths_of(seen)),
        landmarks,
        np.array(expected),
        AssociationConfig(**config).map_limits,
        Surfaces(room, lengths_of(room)),
        len(known),
        view,
        ids,
        pose,
    )
    return room[:count], view, ids, pose


def test_landmarks_and_the_map_are_normalised_to_one_length():
    # The map is turned by 90° against the view, and the current view runs on beyond both ends.
    previous, current = np.array(((0.0, 2, 4, 2),)), np.array(((-1.0, 2.1, 6, 2.1),))
    known, landmarks, matched = np.array(((5.0, 0, 5, 4),)), np.array((0,)), np.array((0,))
    compiled.normalise(previous, current, matched, landmarks, known)
    np.testing.assert_allclose(previous, [(-1, 2, 6, 2)])
    np.testing.assert_allclose(current, [(-1, 2.1, 6, 2.1)])
    np.testing.assert_allclose(known, [(5, -1, 5, 6)])


def carried(
    current: list[tuple[float, ...]], known: list[tuple[float, ...]]
) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """The map, the view and the IDs, where the view's first surface is the map's."""
    seen, landmarks = np.array(current, float), np.full(len(current), compiled.UNKNOWN)
    landmarks[0] = 0
    surfaces, view, ids, _ = carry(seen, landmarks, np.array(known, float))
    return surfaces, view, ids.tolist()


@pytest.mark.parametrize("expected", [(7.0, 0.0, 90.0), (7.3, 0.0, 90.0), (7.0, 0.0, 94.0)])
def test_a_new_surface_keeps_its_position_relative_to_the_landmark(expected):
    """The landmark, seen along x, lies along y in the map: the map is turned by 90°."""
    seen, known = np.array(((0.0, 2, 4, 2), (4, 2, 4, -1))), np.array(((5.0, 0, 5, 4),))
    *place, turn = expected
    surfaces, _, ids, _ = carry(
        seen, np.array((0, -1)), known, (*place, np.radians(turn)), map_turn=0.3, map_shift=0.5
    )
    assert ids.tolist() == [0, 1]
    # Along the landmark the expected pose tells, and across it somewhat.
    np.testing.assert_allclose(surfaces[1, ::2], (5, 8), atol=0.25)
    if expected == (7.0, 0.0, 90.0):
        np.testing.assert_allclose(surfaces[1], (5, 4, 8, 4), atol=1e-12)


def test_the_nearer_a_landmark_the_more_it_counts():
    seen = np.array(((0.0, 2, 4, 2), (8, 2, 12, 2), (13, 2, 13, 5), (-1, 2, -1, 5)))
    # In the map the second landmark lies 0.15 m aside of where the first one says.
    known = np.array(((0.0, 2, 4, 2), (8, 2.15, 12, 2.15)))
    landmarks = np.array((0, 1, -1, -1))
    surfaces, *_, pose = carry(seen, landmarks, known)
    near_second, near_first = surfaces[2:, 1] - 2
    assert near_second > 0.05
    assert near_first < 0.2 * near_second
    # The robot is nearer to the first.
    assert abs(pose[1]) < 0.2 * near_second
    surfaces, *_ = carry(seen, landmarks, known, map_slope=0.0)
    assert surfaces[2, 1] == pytest.approx(surfaces[3, 1])


def test_along_a_landmark_one_that_crosses_it_tells():
    """The odometer says 0.3 m too little along the corridor, at whose end there is a wall."""
    seen = np.array(((0.0, 2, 9.7, 2), (10, 1, 10, -3), (6, -2, 8, -2)))
    known = np.array(((0.0, 2, 9.7, 2), (10.3, 1, 10.3, -3)))
    surfaces, _, _, pose = carry(seen, np.array((0, 1, -1)), known, map_shift=0.5, map_slope=0.0)
    shift = pose[0]
    assert 0.1 < shift < 0.3
    np.testing.assert_allclose(surfaces[2], (6 + shift, -2, 8 + shift, -2), atol=1e-9)
    np.testing.assert_allclose(pose[1:], 0.0, atol=1e-9)


def test_a_turned_landmark_counts_less_the_shorter_it_was_seen():
    """A short surface's direction in the map is 5° wrong; the long ones tell."""
    turn = np.radians(5.0)
    seen = np.array(((-4.0, -2, 4, -2), (4, 2, -4, 2), (5, 0, 5, 0.6)))
    known = seen.copy()
    known[2, 2:] = 5 - 0.6 * np.sin(turn), 0.6 * np.cos(turn)
    *_, pose = carry(seen, np.array((0, 1, 2)), known)
    assert abs(pose[2]) < np.radians(0.8)


def test_without_landmarks_the_expected_pose_carries_all_over():
    seen, expected = np.array(((1.0, 0, 3, 0),)), (2.0, 1.0, np.pi / 2)
    surfaces, _, ids, pose = carry(seen, np.array((-1,)), np.empty((0, 4)), expected)
    assert ids.tolist() == [0]
    np.testing.assert_allclose(surfaces, [(2, 2, 2, 4)], atol=1e-12)
    np.testing.assert_allclose(pose, expected, atol=1e-12)


def test_what_comes_to_lie_close_to_a_known_surface_is_that_one():
    wall = (0, 2, 4, 2)
    known, view, ids = carried([wall, (1, -3, 5, -3)], [wall, (2, -3.2, 8, -3.2)])
    assert ids == [0, 1]
    np.testing.assert_allclose(known, [wall, (1, -3.2, 8, -3.2)])
    np.testing.assert_allclose(view[1], (1, -3, 8, -3))


def test_what_intersects_a_known_surface_is_left_out():
    wall, across = (0, 2, 4, 2), (6, -3, 6, 3)
    known, _, ids = carried([wall, (5, 0, 8, 0)], [wall, across])
    assert ids == [0, compiled.UNKNOWN]
    assert len(known) == 2
    # …but not where it only meets it at a corner.
    *_, ids = carried([wall, (5.9, 0, 8, 0)], [wall, across])
    assert ids == [0, 2]


@pytest.mark.parametrize("pose", [(0, 0, 0), (5, -3, 0.9), (-2, 7, 2.5), (40, 1, -1.3)])
@pytest.mark.parametrize("parts", [(0.2, 3.0), (3.0, 0.2), (1.0, 1.0)])
def test_the_shorter_part_beyond_a_crossing_counts_wherever_they_lie(
    pose: tuple[float, ...], parts: tuple[float, float]
) -> None:
    """The surfaces cross at (2, 1), at 60°."""
    way = np.array((0.5, np.sqrt(0.75)))
    crossing = np.add((2, 1, 2, 1), (*(-parts[0] * way), *(parts[1] * way)))
    lines = np.array((crossing, (-1.0, 1.0, 9.0, 1.0)))
    surface, other = transform_segments(np.array(pose, float), lines)
    assert compiled.end_beyond(surface, other) == pytest.approx(min(parts))
    assert compiled.end_beyond(other, surface) == pytest.approx(3.0)


def test_a_landmark_grows_with_its_surface_in_the_map():
    wall = (0, 2, 4, 2)
    known, view, ids = carried([wall, (4.2, 2.05, 7, 2.05)], [wall])
    assert ids == [0, 0]
    np.testing.assert_allclose(known[0], (0, 2, 7, 2))
    np.testing.assert_allclose(view[0], (0, 2, 7, 2))
