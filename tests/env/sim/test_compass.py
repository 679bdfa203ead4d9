"""The compass: closed forms without errors, and its errors by their frequencies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.robot import CONTROL_STEP
from albot_env.sim.compass import COMPASSES, CompassConfig, read_compass
from albot_env.sim.sensing import COMPASS_COUNTER
from albot_env.sim.sensors import choose_sensors
from albot_env.sim.simulator import Simulator
from albot_maps import load_world

KEY = np.uint64(11)


def errors(config: CompassConfig, count: int, key: int = 11, heading: float = 0.7) -> np.ndarray:
    """The errors of the first readings of a compass."""
    constants, number = config.constants, np.uint64(key)
    shown = [
        read_compass(heading, constants, number, COMPASS_COUNTER, reading)
        for reading in range(count)
    ]
    return np.array(wrap_angle(np.array(shown) - heading))


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.0, -3.1, 12.0])
@pytest.mark.parametrize("meridian", [0.0, -2.0])
def test_without_errors_it_shows_the_heading_from_the_meridian(
    heading: float, meridian: float
) -> None:
    constants = CompassConfig(meridian=meridian).constants
    shown = read_compass(heading, constants, KEY, COMPASS_COUNTER, 5)
    assert -math.pi <= shown < math.pi
    assert math.cos(shown - heading + meridian) == pytest.approx(1.0)


def test_noise_is_normal_and_new_at_each_reading() -> None:
    found = errors(CompassConfig(noise=0.05), 20_000)
    assert found.std() == pytest.approx(0.05, rel=0.03)
    assert abs(found.mean()) < 4 * 0.05 / math.sqrt(len(found))
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 0.03


def test_the_opposite_heading_is_as_frequent_as_it_should_be() -> None:
    found = errors(CompassConfig(flipped=0.2), 20_000)
    is_opposite = np.abs(found) > 3
    assert is_opposite.mean() == pytest.approx(0.2, abs=0.012)
    assert np.abs(found[~is_opposite]).max() < 1e-12
    assert errors(CompassConfig(flipped=1.0), 50) == pytest.approx(-math.pi)
    assert np.abs(errors(CompassConfig(), 2000)).max() < 1e-12


def test_drift_is_slow_has_the_same_deviation_at_all_times_and_another_course_each_time() -> None:
    config = CompassConfig(drift=0.1, drift_time=100 * CONTROL_STEP)
    courses = np.array([errors(config, 301, key=key) for key in range(400)])
    assert courses.std(axis=0) == pytest.approx(0.1, rel=0.2)
    assert np.abs(np.diff(courses, axis=1)).max() < 0.1 * math.pi / 2 / 100 * 6
    together = np.array([np.corrcoef(courses[:, 0], courses[:, k])[0, 1] for k in (50, 100, 200)])
    assert together == pytest.approx((math.sqrt(0.5), 0.0, 0.0), abs=0.15)


def test_a_robot_reads_it_at_each_step_from_its_true_heading() -> None:
    world = load_world("square-loop")
    simulator = Simulator(world, sensors=choose_sensors(compass="ideal"))
    reading = simulator.reset(np.random.default_rng(1))
    for _ in range(30):
        assert reading.compass == pytest.approx(simulator.pose[2], abs=1e-9)
        reading = simulator.step(0.3, 1.0)
    bare = Simulator(world, sensors=choose_sensors())
    assert bare.reset(np.random.default_rng(1)).compass is None


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("meridian", math.nan),
        ("noise", -0.1),
        ("drift", math.inf),
        ("drift_time", 0.0),
        ("flipped", 1.5),
    ],
)
def test_wrong_parameters_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"CompassConfig.{field}"):
        CompassConfig(**{field: value})


def test_clouds_make_it_worse() -> None:
    clear, clouded = (errors(COMPASSES[name], 3000) for name in ("polarised", "clouded"))
    assert np.median(np.abs(clouded)) > 2 * np.median(np.abs(clear))
