"""The odometer's rarer errors: ticks, slip, the caster, and what an episode draws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from albot_core.errors import InputError
from albot_core.robot import Wheels
from albot_env.sim import ODOMETERS, PIONEER_3DX, OdometerConfig
from albot_env.sim.odometer import CASTER_PIVOT, CASTER_TRAIL, caster_angle_after
from tests.env.sim.test_odometer import Odometer

BASE = PIONEER_3DX.wheel_base
SKEW = math.radians(1.0)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.booleans()), min_size=1, max_size=60),
    st.sampled_from([1e-5, 1e-3, 0.03]),
)
def test_no_tick_is_ever_lost(ways: list[tuple[float, float, bool]], tick: float) -> None:
    """Heading adds up to the ticks that have passed on either side, however it is read."""
    odometer = Odometer(OdometerConfig(tick=tick))
    heading, left, right = 0.0, 0.0, 0.0
    for one, other, reads in [*ways, (0.0, 0.0, True)]:
        odometer.roll(Wheels(one / 10, other / 10), 1.0)
        left, right = left + one / 10, right + other / 10
        if reads:
            heading += odometer.read()[2]
    passed = [math.floor(way / tick + 1e-7) for way in (left, right)]
    error = math.remainder(heading - (passed[1] - passed[0]) * tick / BASE, 2 * math.pi)
    # Where a way ends on a tick, rounding decides whether it has passed.
    on_tick = any(abs(math.remainder(way, tick)) < 1e-9 for way in (left, right))
    assert abs(error) < (1.01 * tick / BASE if on_tick else 1e-9)


def test_ticks_come_one_by_one() -> None:
    odometer = Odometer(OdometerConfig(tick=0.01))
    seen = []
    for _ in range(21):
        odometer.roll(Wheels(0.003, 0.003), 1.0)
        seen.append(odometer.read()[0])
    np.testing.assert_allclose(sorted(set(np.round(seen, 9))), [0.0, 0.01])
    assert sum(seen) == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("left", "right", "deviations", "correlation"),
    [
        (1.0, 1.0, (0.01 / math.sqrt(2), 0.01 * math.sqrt(2) / BASE), 0.0),
        (0.0, 1.0, (0.01 / 2, 0.01 / BASE), 1.0),
        (4.0, 1.0, (0.01 * math.sqrt(5) / 2, 0.01 * math.sqrt(5) / BASE), -3 / 5),
    ],
)
def test_each_wheel_slips_for_itself(
    left: float, right: float, deviations: tuple[float, float], correlation: float
) -> None:
    """Var(half sum) = s²(l + r)/4, var(difference)/b² = s²(l + r)/b², cov = s²(r - l)/2b."""
    config = OdometerConfig(wheel_noise=0.01)
    plain = Odometer(OdometerConfig())
    plain.roll(Wheels(left, right), 1.0)
    truth = plain.read()
    odometer = Odometer(config, key=3)
    errors = []
    for _ in range(4000):
        odometer.roll(Wheels(left, right), 1.0)
        motion = odometer.read()
        along = math.hypot(*motion[:2]) - math.hypot(*truth[:2])
        errors.append((along, math.remainder(motion[2] - truth[2], 2 * math.pi)))
    found = np.array(errors)
    np.testing.assert_allclose(found.std(axis=0), deviations, rtol=0.05)
    assert np.corrcoef(found.T)[0, 1] == pytest.approx(correlation, abs=0.05)


def spins(key: int, parts: int) -> np.ndarray:
    """Distance and heading measured in excess over 100 m, read `parts` times."""
    odometer = Odometer(OdometerConfig(slip_rate=0.05, slip_length=0.02), key)
    total = np.zeros(2)
    for _ in range(parts):
        odometer.roll(Wheels(1.0, 1.0), 100.0 / parts)
        motion = odometer.read()
        total += math.hypot(*motion[:2]), motion[2]
    return total - (100.0, 0.0)


def test_wheels_spin_as_often_and_as_far_as_asked_for() -> None:
    """Compound Poisson: mean n l / 2 along, variance n 2 l² / b² of the heading; n = 5."""
    excess = np.array([spins(key, 1) for key in range(3000)])
    assert excess[:, 0].mean() == pytest.approx(5 * 0.02 / 2, rel=0.05)
    assert excess[:, 0].var() == pytest.approx(5 * 2 * 0.02**2 / 4, rel=0.1)
    assert excess[:, 1].mean() == pytest.approx(0.0, abs=0.01)
    assert excess[:, 1].var() == pytest.approx(5 * 2 * 0.02**2 / BASE**2, rel=0.1)


def test_a_wheel_that_spins_does_so_however_often_it_is_read() -> None:
    for key in range(20):
        np.testing.assert_allclose(spins(key, 1), spins(key, 50), atol=1e-9)


def factors(key: int) -> tuple[float, float]:
    """Distance and turn as Stage measures them: of a metre, and of a radian on the spot."""
    odometer = Odometer(ODOMETERS["stage"], key)
    odometer.roll(Wheels(1.0, 1.0), 1.0)
    distance = odometer.read()[0]
    odometer.roll(Wheels(-BASE / 2, BASE / 2), 1.0)
    return distance, odometer.read()[2]


def test_stage_draws_its_errors_evenly_and_keeps_them_for_the_episode() -> None:
    drawn = np.array([factors(key) for key in range(1500)])
    assert kstest((drawn[:, 0] - 0.985) / 0.03, "uniform").pvalue > 0.01
    assert kstest((drawn[:, 1] - 0.975) / 0.05, "uniform").pvalue > 0.01
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 0.08
    odometer = Odometer(ODOMETERS["stage"], 7)
    again = []
    for _ in range(3):
        odometer.roll(Wheels(1.0, 1.0), 1.0)
        again.append(odometer.read()[0])
    np.testing.assert_allclose(again, [factors(7)[0]] * 3, rtol=1e-12)


def test_a_driving_caster_trails_and_a_turning_one_stands_at_right_angles() -> None:
    assert caster_angle_after(0.3, 2.0, 0.0) == pytest.approx(SKEW)
    # On the spot nothing moves once L cos ψ = -c: the wheel rolls about the axle's middle.
    assert caster_angle_after(0.0, 0.0, 6.0) == pytest.approx(
        -math.acos(-CASTER_TRAIL / CASTER_PIVOT), abs=1e-6
    )
    assert caster_angle_after(0.0, 0.0, -6.0) == pytest.approx(
        math.acos(-CASTER_TRAIL / CASTER_PIVOT), abs=1e-6
    )


def test_a_straight_caster_falls_in_line_as_the_equation_says() -> None:
    """With ω = 0, tan((ψ - skew) / 2) falls as exp(-s / c)."""
    for way in (0.005, 0.02, 0.08):
        angle = caster_angle_after(1.2, way, 0.0)
        expected = math.tan((1.2 - SKEW) / 2) * math.exp(-way / CASTER_TRAIL)
        assert math.tan((angle - SKEW) / 2) == pytest.approx(expected, rel=2e-2)


def test_the_caster_swings_alike_in_one_step_and_in_many() -> None:
    angle = 0.4
    for _ in range(50):
        angle = caster_angle_after(angle, 0.002, 0.01)
    assert caster_angle_after(0.4, 0.1, 0.5) == pytest.approx(angle, abs=2e-3)


def test_a_turn_measures_more_than_it_turns_and_a_reversal_kicks() -> None:
    odometer = Odometer(OdometerConfig(caster_drag=0.02))
    odometer.roll(Wheels(0.5, 0.5), 4.0)
    odometer.read()
    odometer.roll(Wheels(-0.5, -0.5), 4.0)
    kick = odometer.read()[2]
    assert abs(kick) == pytest.approx(0.02 * (math.pi - 2 * SKEW), rel=1e-3)
    for side in (1, -1):
        odometer = Odometer(OdometerConfig(caster_drag=0.02))
        odometer.roll(Wheels(-side * BASE / 2, side * BASE / 2), 2.0)
        excess = side * odometer.read()[2] - 2.0
        assert excess == pytest.approx(0.02 * math.acos(-CASTER_TRAIL / CASTER_PIVOT), rel=1e-2)


def test_slips_need_a_rate_and_a_length() -> None:
    with pytest.raises(InputError, match="both slip_rate and slip_length"):
        OdometerConfig(slip_rate=0.1)
