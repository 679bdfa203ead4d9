"""Which poses belong together where stamps tell the time, and where they do not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.evaluation.moments import (
    BETWEEN_STEPS,
    BY_LINE,
    BY_TIME,
    NOT_PAIRED,
    clock_fault,
    look_up,
    pair_moments,
    rising_times,
    time_order,
)
from albot_core.evaluation.trajectory import Trajectory, alignment_at_start, trajectory_error

GOOD = 100.0 + 0.2 * np.arange(40)
STEPPING = np.where(np.arange(40) < 25, GOOD, GOOD - 3.0)
COARSE = np.round(GOOD, -1)


def line(count: int = 40) -> np.ndarray:
    """Poses along a line, a step apart."""
    return np.stack((0.1 * np.arange(count), np.zeros(count), np.zeros(count)), axis=1)


@pytest.mark.parametrize(
    ("stamps", "fault"),
    [
        (GOOD, None),
        (GOOD[:1], None),
        (np.array([1.0, 2, 2, *range(3, 20)]), None),
        (STEPPING, "the clock steps back by 2.8 s at scan 26"),
        (COARSE, "40 scans share 2 stamps"),
        (np.array([3.0, 2, 1, 4]), "the clock steps back 2 times, first by 1 s at scan 2"),
    ],
)
def test_what_is_wrong_with_stamps(stamps, fault):
    assert clock_fault(stamps, "scan") == fault


def test_times_rise():
    np.testing.assert_array_equal(rising_times(GOOD), GOOD)
    np.testing.assert_allclose(rising_times(STEPPING), GOOD)
    np.testing.assert_array_equal(rising_times(COARSE), np.arange(40))


@settings(deadline=None)
@given(st.lists(st.floats(0, 50), min_size=1, max_size=20).map(np.array))
def test_times_never_fall(stamps):
    times = rising_times(stamps)
    assert len(times) == len(stamps)
    assert (np.diff(times) >= 0).all()


@pytest.mark.parametrize(
    ("first", "second", "pairs", "how"),
    [
        (GOOD, GOOD, 40, BY_LINE),
        (GOOD, GOOD[::2] + 0.004, 20, BY_TIME),
        (GOOD, GOOD[5:] + 100, 0, BY_TIME),
        (COARSE, COARSE, 40, BY_LINE),
        (COARSE, GOOD, 40, BY_LINE),
        (GOOD, STEPPING, 40, BY_LINE),
        (COARSE, GOOD[1:], 0, NOT_PAIRED),
        (GOOD[1:], COARSE, 0, NOT_PAIRED),
        (STEPPING, GOOD[1:], 0, NOT_PAIRED),
        (STEPPING, STEPPING[::2], 20, BETWEEN_STEPS),
    ],
)
def test_pairs(first, second, pairs, how):
    found = pair_moments(first, second)
    assert (len(found.first), len(found.second), found.how) == (pairs, pairs, how)
    if how == BETWEEN_STEPS:
        np.testing.assert_array_equal(found.first, np.arange(40)[::2])


def test_what_has_the_stamp_of_another_is_not_paired():
    stamps = np.array([*range(30), 29.0])
    found = pair_moments(stamps, np.arange(20.0, 32))
    np.testing.assert_array_equal(found.first, np.arange(20, 29))
    assert len(pair_moments(np.arange(20.0, 32), stamps).first) == 9


def test_errors_are_those_of_the_lines_where_stamps_are_shared():
    mine = Trajectory(stamps=COARSE, poses=line())
    bent = line()
    bent[:, 1] = 0.3 * np.sin(bent[:, 0])
    found = trajectory_error(mine, Trajectory(stamps=COARSE, poses=bent))
    expected = trajectory_error(
        Trajectory(stamps=GOOD, poses=line()), Trajectory(stamps=GOOD, poses=bent)
    )
    assert found is not None
    assert found == expected
    assert trajectory_error(mine, Trajectory(stamps=GOOD[1:], poses=bent[1:])) is None


def test_the_start_is_the_first_of_the_estimate():
    order = np.array([3, 1, 0, 2])
    reference = Trajectory(stamps=GOOD[:4][order] + 0.001, poses=line()[:4][order] + (5, 0, 0))
    estimate = Trajectory(stamps=GOOD[:4], poses=line()[:4])
    frame = alignment_at_start(estimate, reference)
    assert frame is not None
    assert frame == pytest.approx((5 + 0.3, 0, 0))  # By line: four each, one of them out of order.


def test_relations_name_moments_of_a_clock_that_steps_back():
    wanted = np.array([100.0, GOOD[11], GOOD[30] - 3.0, 55.0])
    # Scan 11 is paired with none: scan 26 has its stamp.
    np.testing.assert_array_equal(look_up(STEPPING, wanted, 1e-4), [0, -1, -1, -1])
    off = np.where(np.arange(40) < 25, GOOD, GOOD - 3.05)
    np.testing.assert_array_equal(look_up(off, off[[3, 30, 26]], 1e-4), [3, 30, 26])
    np.testing.assert_array_equal(look_up(COARSE, COARSE[:3], 1e-4), [-1, -1, -1])
    np.testing.assert_array_equal(look_up(np.empty(0), np.ones(1), 1e-4), [-1])


@settings(deadline=None)
@given(st.permutations(range(12)))
def test_messages_that_arrive_late_are_sorted(order):
    order = np.array(order)
    stamps, poses = GOOD[:12][order], line(12)[order]
    found = time_order(stamps, poses)
    assert found.tolist() in (np.argsort(stamps).tolist(), list(range(12)))
    way = np.abs(np.diff(poses[found, 0])).sum()
    assert way <= np.abs(np.diff(poses[:, 0])).sum() + 1e-9
    assert time_order(stamps, poses, lines_have_order=False).tolist() == np.argsort(stamps).tolist()


def test_a_clock_that_steps_back_sorts_nothing():
    for keep in (True, False):
        order = time_order(STEPPING, line(), lines_have_order=keep)
        np.testing.assert_array_equal(order, np.arange(40))
