"""The odometer: systematic errors in closed form, random ones by their statistics; its drift."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.robot import Wheels
from albot_env.sim import ODOMETERS, PIONEER_3DX, OdometerConfig
from albot_env.sim.odometer import ODOMETER_COUNT, ODOMETER_DRAWS, read_odometer, roll_wheels

BASE = PIONEER_3DX.wheel_base


class Odometer:
    """The compiled odometer of one robot."""

    def __init__(self, config: OdometerConfig, key: int = 0) -> None:
        self.errors = config.constants(BASE)
        self.count = np.zeros(1, ODOMETER_COUNT)[0]
        self.key = np.uint64(key)
        self.place = 0
        self.read()  # as an episode begins

    def roll(self, wheels: Wheels, duration: float) -> None:
        roll_wheels(self.count, *wheels, duration, self.errors)

    def read(self) -> np.ndarray:
        motion = np.empty(3)
        read_odometer(self.count, self.errors, self.key, self.place, motion)
        self.place += ODOMETER_DRAWS
        return motion


def measured(config: OdometerConfig, left: float, right: float) -> np.ndarray:
    """The motion measured, without noise, when the wheels roll so far (m) at even speed."""
    odometer = Odometer(config)
    for _ in range(500):
        odometer.roll(Wheels(left / 10, right / 10), 0.02)
    return odometer.read()


def test_an_ideal_odometer_measures_lines_and_arcs_exactly() -> None:
    np.testing.assert_allclose(measured(OdometerConfig(), 2.0, 2.0), [2.0, 0.0, 0.0], atol=1e-12)
    angle = 1.2
    radius = 0.8
    left, right = (radius - BASE / 2) * angle, (radius + BASE / 2) * angle
    arc = [radius * math.sin(angle), radius * (1 - math.cos(angle)), angle]
    np.testing.assert_allclose(measured(OdometerConfig(), left, right), arc, atol=1e-12)


def test_larger_wheels_go_farther_than_measured() -> None:
    x, y, heading = measured(OdometerConfig(scale_error=0.01), 10.0, 10.0)
    assert (x, y, heading) == pytest.approx((10.0 / 1.01, 0.0, 0.0))


def test_a_larger_right_wheel_is_measured_as_a_turn_to_the_right_on_a_straight_way() -> None:
    _, _, heading = measured(OdometerConfig(wheel_difference=0.001), 10.0, 10.0)
    assert heading == pytest.approx(-0.001 * 10.0 / BASE, rel=1e-3)


def test_a_wider_base_turns_less_than_measured() -> None:
    left, right = -0.5 * BASE, 0.5 * BASE
    _, _, heading = measured(OdometerConfig(wheel_base_error=0.05), left, right)
    assert heading == pytest.approx(1.05)


def test_a_heading_bias_turns_with_time_while_the_wheels_turn() -> None:
    config = OdometerConfig(heading_bias=math.radians(1.5))
    _, _, heading = measured(config, 1.0, 1.0)
    assert heading == pytest.approx(math.radians(15.0))
    np.testing.assert_array_equal(measured(config, 0.0, 0.0), np.zeros(3))


def readings(config: OdometerConfig, steps: int, parts: int) -> np.ndarray:
    """1500 times the motion over `parts` readings of `steps` physics steps at 1 m/s."""
    odometer = Odometer(config)
    ends = []
    for _ in range(1500):
        pose = np.zeros(3)
        for _ in range(parts):
            for _ in range(steps):
                odometer.roll(Wheels(1.0, 1.0), 1.0 / steps / parts)
            pose = compose(pose, odometer.read())
        ends.append(pose)
    return np.array(ends)


@pytest.mark.parametrize("parts", [1, 10])
def test_random_errors_grow_with_the_way_however_often_it_is_read(parts: int) -> None:
    ends = readings(OdometerConfig(distance_noise=0.02, drift_noise=0.03), 1, parts)
    assert ends[:, 0].std() == pytest.approx(0.02, rel=0.08)
    assert ends[:, 2].std() == pytest.approx(0.03, rel=0.08)
    # The middle of the way bends too: sideways sigma L/sqrt(3) continuously, L/2 in one.
    sideways = 0.03 / 2 if parts == 1 else 0.03 * math.sqrt(1 / 3 - 1 / 12 / parts**2)
    assert ends[:, 1].std() == pytest.approx(sideways, rel=0.08)
    assert np.abs(ends.mean(axis=0) - [1.0, 0.0, 0.0]).max() < 3e-3


def test_random_errors_of_a_turn_grow_with_the_angle() -> None:
    odometer = Odometer(OdometerConfig(turn_noise=0.05))
    turns = []
    for _ in range(1500):
        odometer.roll(Wheels(-BASE, BASE), 1.0)
        turns.append(odometer.read()[2])
    assert np.std(turns) == pytest.approx(0.05 * math.sqrt(2.0), rel=0.08)
    assert np.mean(turns) == pytest.approx(2.0, abs=5e-3)


def error_after_a_square(odometer: Odometer) -> float:
    """Distance (m) between the true and the believed end of a square of 4 × 25 m, left turns."""
    believed = np.zeros(3)
    quarter = math.pi / 4 * BASE
    for _ in range(4):
        for _ in range(25):
            odometer.roll(Wheels(1.0, 1.0), 1.0)
            believed = compose(believed, odometer.read())
        odometer.roll(Wheels(-quarter, quarter), 1.0)
        believed = compose(believed, odometer.read())
    return math.hypot(believed[0], believed[1])


@pytest.mark.parametrize(
    ("name", "low", "high"), [("ideal", 0.0, 1e-9), ("pioneer", 3.5, 5.7), ("poor", 10.0, 25.0)]
)
def test_the_presets_end_as_far_off_after_100_m_as_they_say(
    name: str, low: float, high: float
) -> None:
    odometer = Odometer(ODOMETERS[name])
    errors = [error_after_a_square(odometer) for _ in range(200)]
    assert low <= np.median(errors) <= high


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("drift_noise", -0.1),
        ("scale_error", math.nan),
        ("wheel_base_error", -1.0),
        ("tick", -1e-3),
        ("turn_spread", 2.0),
        ("slip_length", 0.1),
    ],
)
def test_impossible_errors_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"OdometerConfig.{field}: expected"):
        OdometerConfig(**{field: value})


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
