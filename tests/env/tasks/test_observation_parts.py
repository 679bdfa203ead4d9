"""The parts of an observation, worked out by hand.

The oracle of whole observations calls the same functions, so it does not see what is wrong in them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_env.tasks.core.parts.beliefs import (
    locate_home,
    observe_confidence,
    observe_exit,
    observe_home,
    observe_time,
    observe_way,
)
from albot_env.tasks.core.parts.scales import make_log_scale, scaled, unscaled
from albot_env.tasks.core.parts.sensors import find_nearest, observe_motion

SCALE = make_log_scale(1.0, 7.0)
"""One that is easy: lengths of 0, 1, 3 and 7 m are 0, 1, 2 and 3 doublings of 1 m + length."""
SHOWN = {0.0: -1.0, 1.0: -1 / 3, 3.0: 1 / 3, 7.0: 1.0, 80.0: 1.0}
BELIEF = np.array((2.0, 1.0, math.pi / 2))
"""Two metres east, one north, and looking north: ahead is north, left is west."""
DIAGONAL = math.sqrt(0.5)


@pytest.mark.parametrize(("length", "number"), SHOWN.items())
def test_the_scale_by_hand(length: float, number: float) -> None:
    assert scaled(length, SCALE) == pytest.approx(number)
    assert unscaled(number, SCALE) == pytest.approx(min(length, 7.0))
    assert observe_time(length, SCALE) == pytest.approx(number)


def test_no_time_is_left_after_the_end() -> None:
    assert observe_time(-3.0, SCALE) == -1.0


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        # An exit from (1, 4) to (3, 4): its middle 3 m ahead. With the place on its left, north
        # of it, the way out leads south, back against the robot.
        ((1, 4, 3, 4), (1, 0, 1 / 3, -1, 0, 1)),
        ((3, 4, 1, 4), (1, 0, 1 / 3, 1, 0, 1)),
        # A line north from (5, 0) to (5, 2): 3 m to the right, and passed to the east: right.
        ((5, 0, 5, 2), (0, -1, 1 / 3, 0, -1, 1)),
        ((5, 2, 5, 0), (0, -1, 1 / 3, 0, 1, 1)),
        # Behind and to the left of the robot at (1, 0), passed to the north-east.
        ((0.5, 0.5, 1.5, -0.5), (-DIAGONAL, DIAGONAL, None, -DIAGONAL, DIAGONAL, 1)),
        ((math.nan,) * 4, (0, 0, -1, 0, 0, -1)),
    ],
)
def test_an_exit_by_hand(line: tuple[float, ...], expected: tuple[float | None, ...]) -> None:
    row = np.full(6, 9.0, np.float32)
    observe_exit(BELIEF, np.array(line, float), SCALE, row)
    for seen, wanted in zip(row.tolist(), expected, strict=True):
        if wanted is not None:
            assert seen == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((2, 4), (1, 0, 1 / 3, 1)),
        ((5, 1), (0, -1, 1 / 3, 1)),
        ((1, 2), (DIAGONAL, DIAGONAL, None, 1)),
        ((math.nan, math.nan), (0, 0, -1, -1)),
    ],
)
def test_a_way_by_hand(point: tuple[float, float], expected: tuple[float | None, ...]) -> None:
    row = np.full(4, 9.0, np.float32)
    observe_way(BELIEF, np.array(point, float), SCALE, row)
    for seen, wanted in zip(row.tolist(), expected, strict=True):
        if wanted is not None:
            assert seen == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize(
    ("home", "expected"),
    [((3, 0), (1, 0, 1 / 3)), ((0, -7), (0, -1, 1)), ((-1, 0), (-1, 0, -1 / 3)),
     ((0, 0), (1, 0, -1))],
)  # fmt: skip
def test_home_by_hand(home: tuple[float, float], expected: tuple[float, ...]) -> None:
    row = np.full(3, 9.0, np.float32)
    observe_home(np.array((*home, 0.0)), SCALE, row)
    assert row == pytest.approx(np.array(expected), abs=1e-6)


def test_home_lies_where_it_is_from_the_robot() -> None:
    home = np.full(3, 9.0)
    turn = math.cos(BELIEF[2]), math.sin(BELIEF[2])
    locate_home(BELIEF, turn, np.array((5.0, 3.0, -3.0)), home)
    assert home == pytest.approx((2.0, -3.0, 2 * math.pi - 3.0 - math.pi / 2))


def test_motion_by_hand() -> None:
    row = np.full(3, 9.0, np.float32)
    observe_motion(np.array((0.05, -0.025, 0.1)), 0.1, 0.2, row)
    assert row == pytest.approx((0.5, -0.25, 0.5))
    observe_motion(np.array((0.5, -0.5, -9.0)), 0.1, 0.2, row)
    assert row.tolist() == [1.0, -1.0, -1.0]


def test_the_nearest_of_each_sector_is_seen() -> None:
    nearest = np.full(3, 9.0)
    find_nearest(np.array((5.0, 4.0, 3.0, 1.0, 2.0, 6.0, 8.0)), nearest)
    assert nearest.tolist() == [4.0, 1.0, 2.0]  # Two, two and three beams.


def test_confidence_is_the_share_of_a_normal_distribution() -> None:
    """Of 20,000 points drawn about home, so many are near it."""
    travel, drift, near = 20.0, 0.1, 2.5
    points = np.random.default_rng(1).normal(0.0, drift * travel, (20_000, 2))
    share = np.mean(np.hypot(*points.T) < near)
    assert observe_confidence(travel, drift, near) == pytest.approx(2 * share - 1, abs=0.02)
    assert observe_confidence(0.0, drift, near) == 1.0
