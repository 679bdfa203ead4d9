"""Precision and recall by hand, and places that are known again where structure is plain."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.evaluation.recognition import Recognition, measure_recognition
from albot_core.geometry.poses import compose, relative, transform_segments
from albot_core.sensing.reading import Reading
from tests.core.scenes import scan_from


def claimed(scores: list[float], right: list[bool], queries: int) -> Recognition:
    return Recognition(
        scores=np.array(scores, float),
        right=np.array(right, bool),
        queries=queries,
        pair_scores=np.array(scores, float),
        pair_near=np.array(right, bool),
    )


def test_the_curve_by_hand():
    found = claimed([3.0, 9.0, 5.0, 5.0, 7.0], [False, True, False, True, True], queries=4)
    expected = [(1 / 4, 1), (2 / 4, 1), (3 / 4, 3 / 4), (3 / 4, 3 / 5)]
    np.testing.assert_allclose(found.curve, expected)
    assert found.recall_at(1.0) == 0.5
    assert found.recall_at(0.75) == 0.75
    assert found.recall_at(0.0) == 0.75


def test_a_false_alarm_above_all_leaves_no_recall_without_one():
    found = claimed([9.0, 5.0], [False, True], queries=1)
    assert found.recall_at(1.0) == 0.0
    assert found.recall_at(0.5) == 1.0


def test_nothing_claimed_is_nothing_recalled():
    found = claimed([], [], queries=0)
    assert found.curve.shape == (0, 2)
    assert found.recall_at(1.0) == 0.0


def test_the_pairs_by_hand():
    found = claimed([3.0, 9.0, 5.0, 5.0, 7.0], [False, True, False, True, True], queries=4)
    expected = [(1 / 3, 0), (2 / 3, 0), (1, 1 / 2), (1, 1)]
    np.testing.assert_allclose(found.pair_curve, expected)
    assert found.detection_at(0.0) == 2 / 3
    assert found.detection_at(0.49) == 2 / 3
    assert found.detection_at(0.5) == 1.0


def hall() -> np.ndarray:
    """A hall of 30 x 8 m with screens about, no two alike (m)."""
    rng = np.random.default_rng(5)
    middles = np.stack(
        (rng.uniform(-4, 28, 22), rng.choice([-1, 1], 22) * rng.uniform(1.8, 3.8, 22))
    )
    turns, half = rng.uniform(0, np.pi, 22), 0.5 * rng.uniform(0.8, 1.6, 22)
    reach = half * np.stack((np.cos(turns), np.sin(turns)))
    box = [(-6, -4, 30, -4), (30, -4, 30, 4), (30, 4, -6, 4), (-6, 4, -6, -4)]
    return np.concatenate((box, np.concatenate((middles - reach, middles + reach)).T))


def there_and_again() -> np.ndarray:
    """Along the hall, back in a turn on the spot, and along it again: poses (n, 3)."""
    ahead = [(x, 0.0, 0.0) for x in np.arange(0, 21.5, 1.4)]
    back = [(x, 0.0, np.pi) for x in np.arange(21, -1.5, -1.4)]
    return np.array([*ahead, *back, *ahead])


def readings_of(path: np.ndarray, walls: np.ndarray) -> list[Reading]:
    return [
        Reading(
            stamp=float(k), motion=relative(path[max(k - 1, 0)], pose), laser=scan_from(pose, walls)
        )
        for k, pose in enumerate(path)
    ]


@pytest.fixture(scope="module")
def readings() -> list[Reading]:
    return readings_of(there_and_again(), hall())


def test_places_of_a_hall_are_known_again(readings):
    found = measure_recognition(readings, there_and_again())
    # Along it again the robot sees what it saw, and is sure; on the way back much is new.
    assert found.queries == 9
    assert found.right[-5:].all()
    assert found.recall_at(1.0) >= 0.4
    assert found.recall_at(0.75) >= 0.7


def test_the_measure_is_of_the_truth_and_the_truth_alone(readings):
    # With true poses that never come near each other there is nothing to be recognised.
    apart = there_and_again()
    apart[:, 0] = 100.0 * np.arange(len(apart))
    found = measure_recognition(readings, apart)
    assert found.queries == 0
    assert not found.right.any()
    assert found.recall_at(0.0) == 0.0


def test_moving_the_whole_world_changes_nothing(readings):
    motion = np.array([13.0, -7.0, 1.1])
    path = compose(motion, there_and_again())
    moved = readings_of(path, transform_segments(motion, hall()))
    here, there = measure_recognition(readings, there_and_again()), measure_recognition(moved, path)
    np.testing.assert_allclose(there.scores, here.scores, atol=0.01)
    assert (there.queries, there.right.tolist()) == (here.queries, here.right.tolist())
