"""The odometer's drift over 100 m straight on and round a square, against its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.geometry.poses import compose
from albot_env.sim import ODOMETERS, PIONEER_3DX, OdometerConfig
from albot_env.sim.drive import Wheels
from tests.env.sim.test_odometer import Odometer

BASE = PIONEER_3DX.wheel_base
SPEED = 0.5
SPIN = 1.0

CASES = {
    "scale": OdometerConfig(scale_error=0.01),
    "wheels": OdometerConfig(wheel_difference=0.002),
    "base": OdometerConfig(wheel_base_error=0.03),
    "bias": OdometerConfig(heading_bias=math.radians(-1.5)),
    "all": OdometerConfig(
        scale_error=-0.02, wheel_difference=-0.003, wheel_base_error=-0.04, heading_bias=0.002
    ),
}


def arc(length: float, turn: float) -> np.ndarray:
    """The end of an arc of this length and turn."""
    if turn == 0:
        return np.array((length, 0.0, 0.0))
    radius = length / turn
    return np.array((radius * math.sin(turn), radius * (1 - math.cos(turn)), turn))


def leg(config: OdometerConfig, length: float) -> np.ndarray:
    """What is measured of `length` (m) straight on at SPEED, by the wheels' true diameters."""
    ratio, mean = 1 + config.wheel_difference, 1 + config.scale_error
    left, right = 2 * mean / (1 + ratio), 2 * mean * ratio / (1 + ratio)  # true diameters
    base = BASE / (1 + config.wheel_base_error)
    bias = config.heading_bias * length / SPEED
    return arc(length * (1 / left + 1 / right) / 2, length * (1 / right - 1 / left) / base + bias)


def quarter(config: OdometerConfig) -> np.ndarray:
    """What is measured of a quarter turn to the left on the spot at SPIN."""
    ratio, mean = 1 + config.wheel_difference, 1 + config.scale_error
    left, right = 2 * mean / (1 + ratio), 2 * mean * ratio / (1 + ratio)
    way = math.pi / 4 * BASE
    turn = way * (1 / right + 1 / left) * (1 + config.wheel_base_error) / BASE
    bias = config.heading_bias * math.pi / 2 / SPIN
    return arc(way * (1 / right - 1 / left) / 2, turn + bias)


def drive(odometer: Odometer, length: float) -> np.ndarray:
    odometer.roll(Wheels(SPEED, SPEED), length / SPEED)
    return odometer.read()


def turn_left(odometer: Odometer) -> np.ndarray:
    odometer.roll(Wheels(-SPIN * BASE / 2, SPIN * BASE / 2), math.pi / 2 / SPIN)
    return odometer.read()


@pytest.mark.parametrize("name", CASES)
def test_drift_over_100_m_straight_on(name: str) -> None:
    odometer, believed = Odometer(CASES[name]), np.zeros(3)
    for _ in range(1000):
        believed = compose(believed, drive(odometer, 0.1))
    expected = leg(CASES[name], 100.0)
    np.testing.assert_allclose(believed[:2], expected[:2], atol=1e-8)
    assert math.remainder(believed[2] - expected[2], 2 * math.pi) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_drift_round_a_square_of_25_m(name: str) -> None:
    config = CASES[name]
    odometer, believed, expected = Odometer(config), np.zeros(3), np.zeros(3)
    for _ in range(4):
        for _ in range(50):
            believed = compose(believed, drive(odometer, 0.5))
        believed = compose(believed, turn_left(odometer))
        expected = compose(compose(expected, leg(config, 25.0)), quarter(config))
    np.testing.assert_allclose(believed[:2], expected[:2], atol=1e-8)
    assert math.remainder(believed[2] - expected[2], 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert math.hypot(*believed[:2]) > 0.5  # the errors are errors


def test_a_bias_closes_a_square_to_the_paper_s_figure() -> None:
    """Milford et al.: 6 deg/s makes the loop almost straight; 36 s at 0.5 m/s are 216 degrees."""
    odometer, heading = Odometer(ODOMETERS["bias-6"]), 0.0
    for _ in range(36):
        heading += drive(odometer, 0.5)[2]
    assert heading == pytest.approx(math.radians(216))


def test_what_hossain_added_is_added_to_each_metre() -> None:
    plain = drive(Odometer(quiet("pioneer")), 1.0)
    disturbed = drive(Odometer(quiet("albot1-disturbed")), 1.0)
    assert disturbed[0] - plain[0] == pytest.approx(0.1, rel=2e-3)
    assert disturbed[2] - plain[2] == pytest.approx(math.radians(1.0), rel=2e-3)


def quiet(name: str) -> OdometerConfig:
    """The preset without its random errors."""
    values = vars(ODOMETERS[name])
    return OdometerConfig(**{k: v for k, v in values.items() if not k.endswith("_noise")})
