"""A robot lifted and put down elsewhere knows it, goes on, and finds out where it is."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import relative
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from albot_experiments.tours import TourRecord


def what_happened(mapper: Albot1) -> list[EventKind]:
    return [event.kind for event in mapper.events]


def test_a_moved_robot_knows_it_and_finds_out_where_it_is(ring_journey: TourRecord):
    mapper = Albot1()
    for reading in ring_journey.readings[:109]:
        mapper.update(reading)
    assert mapper.estimate.localised
    lost, weighed = [], []
    for reading in ring_journey.readings[65:85]:  # out of P6 back into P4
        mapper.update(reading)
        lost.append(not mapper.estimate.localised)
        weighed.append(mapper.hypotheses)
        assert np.isfinite(mapper.estimate.pose).all()
        assert np.isfinite(mapper.snapshot().segments).all()
    assert lost.index(True) == 1
    assert not lost[-1]
    assert any(weighed)
    assert not any(weighed[k] for k in range(20) if not lost[k])
    assert {EventKind.LOST, EventKind.RELOCALISED} <= set(what_happened(mapper))
    home = relative(ring_journey.truth[84], ring_journey.truth[0])
    assert np.hypot(*(mapper.estimate.home_from_robot - home)[:2]) < 1.0


def test_one_that_is_lost_can_be_saved(ring_journey: TourRecord):
    mapper, other = Albot1(), Albot1()
    for reading in (*ring_journey.readings[:109], *ring_journey.readings[65:67]):
        mapper.update(reading)
    assert not mapper.estimate.localised
    other.restore(mapper.state())
    assert not other.estimate.localised
    for reading in ring_journey.readings[67:75]:
        assert mapper.update(reading) == other.update(reading)
        assert np.array_equal(mapper.estimate.pose, other.estimate.pose)
    assert mapper.events == other.events
    assert other.estimate.localised


def test_a_blackout_is_borne(ring_journey: TourRecord):
    mapper = Albot1()
    for view, reading in enumerate(ring_journey.readings[:80]):
        dark = LaserScan(ranges=np.full(181, np.inf), geometry=reading.laser.geometry)
        laser = dark if 40 <= view < 44 else reading.laser
        mapper.update(Reading(stamp=reading.stamp, motion=reading.motion, laser=laser))
    assert mapper.estimate.localised
    assert EventKind.LOST not in what_happened(mapper)
    believed = relative(ring_journey.truth[0], ring_journey.truth[79])
    assert np.hypot(*(mapper.estimate.pose - believed)[:2]) < 0.5


def test_one_misread_view_is_not_a_move(ring_journey: TourRecord):
    mapper = Albot1()
    for view, reading in enumerate(ring_journey.readings[:80]):
        laser = ring_journey.readings[5].laser if view == 60 else reading.laser
        mapper.update(Reading(stamp=reading.stamp, motion=reading.motion, laser=laser))
    assert EventKind.LOST not in what_happened(mapper)


def test_nobody_who_is_only_driven_is_lost(ring_journey: TourRecord):
    for mapper in (Albot1(), Albot1.thesis()):
        for reading in ring_journey.readings:
            mapper.update(reading)
        assert EventKind.LOST not in what_happened(mapper)


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), thesis=st.booleans())
def test_any_readings_leave_a_finite_map(seed: int, thesis: bool):
    rng = np.random.default_rng(seed)
    mapper = Albot1.thesis() if thesis else Albot1()
    for view in range(30):
        beams = int(rng.choice([2, 5, 61, 181]))
        geometry = LaserGeometry(
            beams=beams, spacing=float(rng.uniform(0.1, 1.0) * 6.0 / (beams + 2))
        )
        ranges = np.repeat(rng.uniform(0.01, 35.0, beams), 10)[:beams]
        ranges[rng.random(beams) < 0.2] = np.inf
        motion = rng.normal(0.0, 0.5, 3) * rng.integers(0, 2)
        scan = LaserScan(ranges=ranges, geometry=geometry)
        mapper.update(Reading(stamp=0.1 * view, motion=motion, laser=scan))
        for array in (
            mapper.estimate.pose,
            mapper.estimate.home_from_robot,
            mapper.snapshot().segments,
            mapper.exits,
        ):
            assert np.isfinite(array).all()
