"""Algorithm 1 on two views that are known by heart."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import inverse, transform_segments
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.frames import seen_from
from albot_core.mappers.albot1.perceptual_map.mapping import LANDMARK_PAIR, recognize_landmarks
from albot_core.mappers.albot1.perceptual_map.memory import NOT_RECOGNIZED, LocatedView, empty_view
from albot_core.sensing.view import CORNER, NO_EDGE

LIMITS = Albot1Config.thesis().limits
WALLS = np.array([[3.0, -2.0, 3.0, -0.5], [4.0, 1.0, 2.0, 2.0]])


def sight_of(surfaces: np.ndarray, ends: tuple[int, int] = (CORNER, CORNER)) -> LocatedView:
    view = empty_view(4)
    view.surfaces[: len(surfaces)] = surfaces
    view.edges[:] = ends
    view.landmark[: len(surfaces)] = True
    view.slots[: len(surfaces)] = np.arange(len(surfaces)) + 10
    view.size[0] = len(surfaces)
    return view


def no_pairs() -> np.ndarray:
    """Room for what tells of four landmarks."""
    return np.zeros(4, LANDMARK_PAIR)


def recognized(motion: np.ndarray, seen: np.ndarray, **ends: tuple[int, int]) -> list[int]:
    current = sight_of(seen, **ends)
    count = recognize_landmarks(sight_of(WALLS), current, motion, LIMITS, no_pairs())
    slots = current.slots[: len(seen)].tolist()
    assert count == sum(slot != NOT_RECOGNIZED for slot in slots)
    return slots


def test_the_equations_are_the_inverse_motion() -> None:
    motion = np.array([0.7, -0.2, 0.6])
    out = np.empty(4)
    seen_from(motion, np.cos(motion[2]), np.sin(motion[2]), WALLS[0], out)
    assert np.allclose(out, transform_segments(inverse(motion), WALLS[:1])[0])


def test_landmarks_are_recognised_across_a_motion() -> None:
    motion = np.array([1.0, 0.1, 0.3])
    seen = transform_segments(inverse(motion), WALLS)
    assert recognized(motion, seen) == [10, 11]
    assert recognized(motion, seen[::-1].copy()) == [11, 10]


@pytest.mark.parametrize(("turned", "expected"), [(4.5, True), (5.5, False)])
def test_the_turn_may_be_wrong_by_less_than_five_degrees(turned: float, expected: bool) -> None:
    # The surface turns about its own first end, so that only the angle is wrong.
    x, y = WALLS[0, :2]
    heading = np.pi / 2 + np.radians(turned)
    seen = np.array([[x, y, x + 1.5 * np.cos(heading), y + 1.5 * np.sin(heading)]])
    assert (recognized(np.zeros(3), seen) == [10]) is expected


@pytest.mark.parametrize(("shift", "expected"), [(0.39, True), (0.41, False)])
def test_the_point_may_be_wrong_by_less_than_forty_centimetres(
    shift: float, expected: bool
) -> None:
    seen = WALLS[:1] + np.array([shift, 0.0, shift, 0.0])
    assert (recognized(np.zeros(3), seen) == [10]) is expected


def test_unstable_ends_do_not_count() -> None:
    assert recognized(np.zeros(3), WALLS, ends=(NO_EDGE, NO_EDGE)) == [NOT_RECOGNIZED] * 2
    # With one end cut off by half the wall the other end still recognises it.
    half = WALLS.copy()
    half[0, 2:] = [3.0, -1.2]
    assert recognized(np.zeros(3), half)[0] == 10


def test_what_was_not_recognised_before_is_not_recognised_now() -> None:
    previous = sight_of(WALLS)
    previous.slots[0] = NOT_RECOGNIZED
    current = sight_of(WALLS)
    assert recognize_landmarks(previous, current, np.zeros(3), LIMITS, no_pairs()) == 1


def test_the_evidence_is_measured() -> None:
    pairs = no_pairs()
    seen = WALLS + np.array([0.1, 0.0, 0.2, 0.0])
    recognize_landmarks(sight_of(WALLS), sight_of(seen), np.zeros(3), LIMITS, pairs)
    assert pairs[0]["end"] == 0
    assert pairs[0]["gap"] == pytest.approx(0.1)
    assert pairs[0]["angle"] == pytest.approx(np.arctan2(0.1, 1.5))
