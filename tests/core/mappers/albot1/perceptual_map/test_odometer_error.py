"""What is learnt of the odometer, in closed form, and how far the search follows it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    HAS_MOVED,
    LAST_X,
    LAST_Y,
    MEMORY,
    SHIFT,
    TURN,
    learn_error,
    note_motion,
    shift_scale,
    turn_scale,
    unknown_odometer,
)

LIMITS = Albot1Config().limits
HERE = np.array((1.0, 2.0, np.pi / 2))


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_the_error_is_a_running_mean_square(turn: float, error: float) -> None:
    odometer, before = unknown_odometer(), unknown_odometer()[TURN]
    there = HERE + np.array((0.0, 1.0, turn))
    learn_error(odometer, HERE, np.array((1.0, 0.0, turn + error)), there, True, False)
    expected = before + (error**2 - before) / MEMORY
    assert odometer[TURN] == pytest.approx(expected, abs=1e-12)
    assert odometer[[LAST_X, LAST_Y]] == pytest.approx((1.0, 0.0), abs=1e-12)


def test_where_the_robot_goes_on_to_is_not_learnt_after_a_misread_view() -> None:
    odometer, there = unknown_odometer(), HERE + np.array((0.0, 1.0, 0.2))
    learn_error(odometer, HERE, np.zeros(3), there, True, True)
    assert odometer[[LAST_X, LAST_Y]].tolist() == [0.0, 0.0]
    assert odometer[TURN] != unknown_odometer()[TURN]


def test_an_odometer_that_slips_holds_the_pose_loosely() -> None:
    odometer, still = unknown_odometer(), np.zeros(3)
    # Until it reports a motion it may be missing, and the robot may go at any speed.
    assert shift_scale(odometer, LIMITS) == pytest.approx(1.0)
    note_motion(odometer, np.array((0.3, 0.0, 0.0)))
    assert shift_scale(odometer, LIMITS) == pytest.approx(0.1)
    for _ in range(300):
        learn_error(odometer, still, np.array((0.3, 0.0, 0.0)), still, True, False)
    assert odometer[SHIFT] == pytest.approx(0.5 * 0.3**2, rel=0.01)
    assert shift_scale(odometer, LIMITS) == pytest.approx(2 * 0.3 / np.sqrt(2), rel=0.01)


def test_an_unsure_match_says_nothing_of_the_odometer() -> None:
    odometer = unknown_odometer()
    learn_error(odometer, HERE, np.array((0.0, 0.0, 0.5)), HERE, False, False)
    assert odometer.tolist() == unknown_odometer().tolist()


def test_the_search_is_wide_for_a_wild_odometer_and_tight_for_a_clean_one() -> None:
    wild, clean, still = unknown_odometer(), unknown_odometer(), np.zeros(3)
    for step in range(200):
        off = np.radians(20.0) * (-1) ** step
        learn_error(wild, still, np.array((0.0, 0.0, off)), still, True, False)
        learn_error(clean, still, still, still, True, False)
    assert turn_scale(wild, LIMITS) == pytest.approx(2.5 * np.radians(20.0), rel=0.01)
    assert turn_scale(clean, LIMITS) == LIMITS.turn_cost


@pytest.mark.parametrize(
    ("motion", "is_told"), [((0.0, 0.0, 1e-16), 0.0), ((0.0, -0.01, 0.0), 1.0)]
)
def test_an_odometer_without_motion_counts_as_missing(
    motion: tuple[float, ...], is_told: float
) -> None:
    odometer = unknown_odometer()
    note_motion(odometer, np.array(motion))
    assert odometer[HAS_MOVED] == is_told
