"""Which winding a loop has, by an odometer with a bias."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.ratslam.winding import HeadingBias, turns_of

STEP, TIME = 0.5, 5 / 3
"""Length (m) and time (s) of a link at 0.3 m/s."""


def lap(bias: float, side: int = 9, corner: float = np.pi / 2) -> tuple[np.ndarray, np.ndarray]:
    """The links round a square as measured, the last one back to the first, and their times."""
    motions = np.tile((STEP, 0.0, 0.0), (4 * side, 1))
    motions[side - 1 :: side, 2] += corner
    excess = bias * TIME
    bent = motions.copy()
    bent[:, 0] = STEP * np.cos(excess / 2)
    bent[:, 1] = STEP * np.sin(excess / 2)
    bent[:, 2] += excess
    return bent, np.full(4 * side, TIME)


def turns(motions: np.ndarray, times: np.ndarray, bias: float) -> int:
    """The whole turns of the link that closes a lap."""
    count = len(motions)
    reached_by = np.arange(-1, count - 1)
    tree = reached_by, np.arange(count - 1), motions[:-1].copy(), times[:-1].copy()
    x, y, turn = motions[-1].tolist()
    return turns_of(count - 1, 0, (x, y, turn), TIME, tree, bias)


@pytest.mark.parametrize("degrees", [0.0, 1.5, 3.0, 6.0, -6.0, 9.0, -12.0])
def test_a_lap_to_the_left_turns_once_whatever_the_bias(degrees):
    bias = np.radians(degrees)
    assert turns(*lap(bias), bias) == -1


def test_without_the_bias_a_lap_at_6_degrees_turns_twice():
    """What the odometer measured closes as well: it cannot be told by the loop alone."""
    motions, times = lap(np.radians(6.0))
    assert times.sum() * 6.0 == pytest.approx(360.0)
    assert turns(motions, times, 0.0) == -2


def test_a_robot_that_drives_in_a_circle_is_not_taken_for_a_biased_one():
    """Its turn rate looks like a bias, but without it the lap would not close."""
    count = 36
    motions = np.tile((STEP, 0.0, 2 * np.pi / count), (count, 1))
    rate = 2 * np.pi / count / TIME
    assert turns(motions, np.full(count, TIME), rate) == -1


def test_the_bias_is_the_turn_rate_of_straight_driving():
    rng, bias = np.random.default_rng(0), HeadingBias()
    assert bias.rate == 0.0
    for k in range(3000):
        corner = np.radians(30) if k % 150 > 120 else 0.0
        rate = np.radians(6.0) + corner + rng.normal(0, 0.05)
        bias.add(0.0 if corner else 0.03, rate * 0.1, 0.1)
    assert np.degrees(bias.rate) == pytest.approx(6.0, abs=0.3)


def test_stamps_that_stand_still_say_nothing_of_the_bias():
    bias = HeadingBias()
    for _ in range(1000):
        bias.add(0.1, 1.0, 0.0)
    assert bias.rate == 0.0
