"""The odometer: its systematic errors in closed form, its random ones by their statistics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_env.sim import ODOMETERS, PIONEER_3DX, OdometerConfig
from albot_env.sim.drive import Wheels
from albot_env.sim.odometer import COUNTS, ODOMETER_DRAWS, read_odometer, roll_wheels

BASE = PIONEER_3DX.wheel_base


class Odometer:
    """The compiled odometer of one robot."""

    def __init__(self, config: OdometerConfig, key: int = 0) -> None:
        self.errors = config.constants(BASE)
        self.count = np.zeros(COUNTS)
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
