"""What landmarks tell of the odometer."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.association.odometer import OdometerModel

LEAST = np.radians(5.0)


def test_a_drift_along_the_way_is_taken_off():
    model, drift = OdometerModel(LEAST), np.radians(-3.0)
    true = np.array((1.2, 0.0, 0.1))
    motion = true + np.array((0, 0, 1.2 * drift))
    np.testing.assert_array_equal(model.expected(motion), motion)
    for _ in range(200):
        model.learn(motion, true)
    np.testing.assert_allclose(model.expected(motion)[:2], motion[:2])
    # What was expected at first keeps a share.
    assert model.expected(motion)[2] == pytest.approx(true[2], abs=0.2 * abs(drift))
    turn = np.array((0.0, 0.0, 0.5))
    np.testing.assert_array_equal(model.expected(turn), turn)


def test_the_standard_deviation_grows_with_errors_and_falls_back():
    model, rng = OdometerModel(LEAST), np.random.default_rng(1)
    assert model.turn_sigma == LEAST
    for _ in range(300):
        error = rng.normal(0, np.radians(12.0))
        model.learn(np.array((0.0, 0.0, error)), np.zeros(3))
    assert model.turn_sigma == pytest.approx(np.radians(12.0), rel=0.25)
    for _ in range(300):
        model.learn(np.zeros(3), np.zeros(3))
    assert model.turn_sigma == LEAST


def test_an_error_of_a_turn_is_the_lesser_way_round():
    model = OdometerModel(LEAST)
    model.learn(np.array((0.0, 0.0, 3.1)), np.array((0.0, 0.0, -3.1)))
    assert model.sums[2] == pytest.approx((2 * np.pi - 6.2) ** 2)
