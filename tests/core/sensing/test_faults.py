"""Faults of readings: their specs, their schedules, and what arrives."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.sensing.faults.fault import Clock, Strikes
from albot_core.sensing.faults.injector import FaultInjector
from albot_core.sensing.faults.registry import (
    READING_FAULTS,
    check_needs,
    fault_rows,
    parse_faults,
    spec_of,
)
from albot_core.sensing.faults.span import Span, parse_span
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    SonarGeometry,
    SonarScan,
)

LASER, SONAR = LaserGeometry(beams=19, spacing=np.pi / 18), SonarGeometry()
STEP, SPEED = 0.1, 0.5
NAMES = sorted(READING_FAULTS)
STREAMS = ["doubled-readings", "late-readings", "lost-readings", "swapped-readings"]
"""Faults after which an odometer tells the same pose as without."""


def _readings(count: int, seed: int = 0) -> Iterator[tuple[Reading, Clock]]:
    rng = np.random.default_rng(seed)
    for k in range(count):
        motion = np.array((SPEED * STEP, *rng.normal(0.0, 0.02, 2))) * (k > 0)
        reading = Reading(
            stamp=k * STEP,
            motion=motion,
            laser=LaserScan(ranges=rng.uniform(0.5, 20.0, LASER.beams), geometry=LASER),
            sonar=SonarScan(ranges=rng.uniform(0.5, 3.0, 8), geometry=SONAR),
            scene=int(rng.integers(5)),
        )
        yield reading, Clock(k * STEP, k * STEP * SPEED)


def _injector(spec: str, seed: int = 1) -> FaultInjector:
    faults = parse_faults(spec, READING_FAULTS)
    return FaultInjector(faults, (seed,), LASER, SONAR)  # type: ignore[arg-type]


def _arrivals(spec: str, count: int = 60, seed: int = 1) -> list[list[Reading]]:
    injector = _injector(spec, seed)
    return [injector.feed(*each, contact=True) for each in _readings(count)]


def _same(one: Reading, other: Reading) -> bool:
    assert one.laser and other.laser and one.sonar and other.sonar
    return (
        (one.stamp, one.scene) == (other.stamp, other.scene)
        and np.array_equal(one.motion, other.motion)
        and np.array_equal(one.laser.ranges, other.laser.ranges)
        and np.array_equal(one.sonar.ranges, other.sonar.ranges)
    )


def _end(readings: list[Reading]) -> np.ndarray:
    return np.asarray(reduce(compose, [each.motion for each in readings]))


@given(
    low=st.floats(0.0, 1e4), more=st.floats(0.0, 1e4), unit=st.sampled_from(["m", "s", "deg", "%"])
)
@settings(max_examples=50, deadline=None)
def test_a_quantity_is_read_from_its_text(low: float, more: float, unit: str) -> None:
    span = Span(low, low + more, unit)
    assert parse_span(str(span), "it", "there") == span


def test_a_spec_is_read_from_its_text() -> None:
    text = "laser-dropout:at=20m,lasting=0.5..5s+odometer-jump:every=10m,length=3m"
    faults = parse_faults(text, READING_FAULTS)
    assert parse_faults(spec_of(faults), READING_FAULTS) == faults
    assert parse_faults(list(faults), READING_FAULTS) == faults
    assert parse_faults(text.split("+"), READING_FAULTS) == faults
    assert parse_faults(None, READING_FAULTS) == parse_faults("", READING_FAULTS) == ()
    assert spec_of(parse_faults("frozen-scan", READING_FAULTS)) == "frozen-scan"


@pytest.mark.parametrize(
    ("spec", "told"),
    [
        ("laser-drop", "did you mean laser-dropout"),
        ("laser-dropout:at=3", "at: expected a number or a range with a unit"),
        ("laser-dropout:at=3deg", "at: expected a quantity in m or s, found 3deg"),
        ("laser-dropout:at=-3m", "at: expected numbers within [0, 1e+06] m, found -3m"),
        ("laser-dropout:lasting=0s", "lasting"),
        ("stuck-beams:share=200%", "share: expected numbers within [0, 100] %"),
        ("laser-dropout:lasting=5..1s", "from a smaller to a larger number"),
        ("laser-dropout:lasting=nans", "lasting"),
        ("laser-dropout:lasting=1e400s", "finite"),
        ("laser-dropout:ta=3m", "did you mean at"),
        ("laser-dropout:at=3m,at=4m", "at twice"),
        ("laser-dropout+", "''"),
        ("laser-dropout:", "found ''"),
        (3, "specs of faults"),
        ([3], "specs of faults"),
    ],
)
def test_a_bad_spec_is_refused_in_one_line(spec: object, told: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_faults(spec, READING_FAULTS)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_fault_is_refused_where_its_sensor_is_missing() -> None:
    faults = parse_faults("laser-dropout+saturated-sonars", READING_FAULTS)
    check_needs(faults, ["laser", "sonar"], "the robot")
    with pytest.raises(InputError, match="sonar, which saturated-sonars needs, of intel"):
        check_needs(faults, ["laser"], "intel.log")
    with pytest.raises(InputError, match="found the odometer alone"):
        check_needs(faults, [], "intel.log")


@pytest.mark.parametrize("name", NAMES)
def test_nothing_changes_before_a_strike_or_long_after(name: str) -> None:
    arrivals = _arrivals(f"{name}:at=2s" + ("" if name == "odometer-jump" else ",lasting=1s"))
    given_ = [reading for reading, _ in _readings(60)]
    quiet = [*range(20), *range(33, 60)]
    assert all(len(arrivals[k]) == 1 and _same(arrivals[k][0], given_[k]) for k in quiet)
    struck = range(20, 31)
    assert any(len(arrivals[k]) != 1 or not _same(arrivals[k][0], given_[k]) for k in struck), (
        "it has struck"
    )


@pytest.mark.parametrize("name", NAMES)
def test_the_first_reading_is_never_struck(name: str) -> None:
    first, _ = next(_readings(1))
    assert _same(_arrivals(f"{name}:at=0s", 1)[0][0], first)


@pytest.mark.parametrize("name", STREAMS)
@given(begin=st.floats(0.0, 3.0), lasting=st.floats(0.05, 2.0), seed=st.integers(0, 99))
@settings(max_examples=8, deadline=None)
def test_the_odometer_counts_on_whatever_arrives(
    name: str, begin: float, lasting: float, seed: int
) -> None:
    arrivals = _arrivals(f"{name}:at={begin:.4f}s,lasting={lasting:.4f}s", seed=seed)
    arrived = [reading for some in arrivals for reading in some]
    np.testing.assert_allclose(
        _end(arrived), _end([reading for reading, _ in _readings(60)]), atol=1e-9
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cut", [10, 21, 24, 40])
def test_a_restored_injector_goes_on_to_the_bit(name: str, cut: int) -> None:
    spec = f"{name}:at=2s,every=0.5s"
    whole, first, second = _injector(spec), _injector(spec), _injector(spec)
    for k, (reading, clock) in enumerate(_readings(60)):
        expected = whole.feed(reading, clock, contact=True)
        if k == cut:
            second.restore(first.state)
            assert second.active == first.active
        injector = first if k < cut else second
        found = injector.feed(reading, clock, contact=True)
        assert len(found) == len(expected)
        assert all(map(_same, found, expected))
    assert second.struck == whole.struck


def test_a_schedule_depends_on_its_own_seed_and_place_alone() -> None:
    fault = parse_faults("laser-dropout:every=2m", READING_FAULTS)[0]
    alone, again, other = (Strikes(fault, (seed, 0)) for seed in (1, 1, 2))
    assert (alone.begins, alone.values) == (again.begins, again.values)
    assert alone.begins != other.begins
    strikes = [_arrivals(spec)[30][0] for spec in ("stuck-beams", "stuck-beams+frozen-odometer")]
    assert np.array_equal(strikes[0].laser.ranges, strikes[1].laser.ranges)  # type: ignore


def test_strikes_come_again() -> None:
    injector = _injector("laser-dropout:at=1s,lasting=0.5s,every=1s")
    counts = []
    for reading, clock in _readings(60):
        injector.feed(reading, clock)
        counts.append(injector.struck)
    assert np.flatnonzero(np.diff(counts)).tolist() == [9, 24, 39, 54]


def test_beams_are_lost_stuck_frozen_and_blind() -> None:
    given_ = [each.laser for each, _ in _readings(60)]
    assert all(given_)
    for name in (
        "laser-dropout",
        "stuck-beams:share=50%",
        "frozen-scan",
        "blind-sector:width=60deg",
    ):
        spec = name + ("," if ":" in name else ":") + "at=2s,lasting=1s"
        laser = _arrivals(spec)[25][0].laser
        assert laser is not None
        now, then = given_[25].ranges, given_[20].ranges  # type: ignore[union-attr]
        if name == "laser-dropout":
            assert np.isinf(laser.ranges).all()
        elif name == "frozen-scan":
            assert np.array_equal(laser.ranges, then)
        elif "stuck" in name:
            stuck = laser.ranges == then
            assert stuck.sum() == round(0.5 * LASER.beams)
            assert np.array_equal(laser.ranges[~stuck], now[~stuck])
        else:
            blind = np.flatnonzero(np.isinf(laser.ranges))
            assert 1 <= len(blind) <= 7
            assert np.array_equal(blind, np.arange(blind[0], blind[-1] + 1))


def test_saturated_sonars_report_their_minimum() -> None:
    sonar = _arrivals("saturated-sonars:at=2s,lasting=1s,share=50%")[25][0].sonar
    assert sonar is not None
    assert (sonar.ranges == SONAR.min_range).sum() == 4


def test_the_odometer_jumps_by_its_length_and_turn() -> None:
    given_ = [each for each, _ in _readings(60)]
    arrived = [some[0] for some in _arrivals("odometer-jump:at=2s,length=3m,turn=90deg")]
    before, after = _end(arrived[:20]), _end(arrived[:21])
    np.testing.assert_allclose(np.hypot(*(after - before)[:2]), 3.0, atol=0.2)
    turn = arrived[20].motion[2] - given_[20].motion[2]
    np.testing.assert_allclose(abs(turn), np.pi / 2)


def test_a_wheel_slips_only_where_it_pushes() -> None:
    injector = _injector("wheel-slip:at=1s,speed=0.4m/s,base=0.4m")
    for k, (reading, clock) in enumerate(_readings(40)):
        (arrived,) = injector.feed(reading, clock, contact=k % 2 == 1)
        slipped = not np.array_equal(arrived.motion, reading.motion)
        assert slipped == (k >= 10 and k % 2 == 1)
        if slipped:
            turn = arrived.motion[2] - reading.motion[2]
            np.testing.assert_allclose(abs(turn), 0.04 / 0.4)


def test_late_readings_are_late_and_in_order() -> None:
    arrivals = _arrivals("late-readings:at=2s,lasting=1s,delay=0.3s")
    assert [len(some) for some in arrivals[18:34]] == [1, 1, 0, 0, 0, *[1] * 7, 4, 1, 1, 1]
    stamps = [each.stamp for some in arrivals for each in some]
    assert stamps == sorted(stamps)


def test_swapped_readings_are_swapped() -> None:
    arrivals = _arrivals("swapped-readings:at=2s,lasting=0.4s")
    numbers = [round(each.stamp / STEP) for some in arrivals for each in some]
    assert numbers[18:26] == [18, 19, 21, 20, 23, 22, 24, 25]


def test_the_table_tells_each_fault_and_parameter() -> None:
    rows = {row.name: row for row in fault_rows(READING_FAULTS)}
    assert rows.keys() == READING_FAULTS.keys()
    for name, kind in READING_FAULTS.items():
        for each in dataclasses.fields(kind):
            assert each.name == "every" or f"`{each.name}`" in rows[name].parameters
