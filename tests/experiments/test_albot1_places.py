"""Networks of places are judged by the rooms that the robot truly was in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.events import STANDS_WITHIN, Event, EventKind, EventLog
from albot_experiments import albot1_c1 as c1
from albot_experiments import albot1_c2 as c2
from albot_experiments import albot1_c3 as c3
from albot_experiments.albot1_e3 import DISTURBANCE
from albot_experiments.albot1_places import (
    Crossing,
    PlacedTour,
    between,
    new_events,
    place_tour,
    same_in_the_end,
)
from albot_experiments.tours import TourRecord
from albot_maps import World, load_world


@pytest.fixture(scope="module")
def ring() -> World:
    return load_world("office-ring")


@pytest.fixture(scope="module")
def once_round(ring: World, ring_journey: TourRecord) -> PlacedTour:
    return place_tour("albot1", ring, ring_journey)


def happened(what: EventKind, place: int, other: int) -> Event:
    return Event(step=1, kind=what, place=place, other=other)


def test_places_merged_one_after_the_other_are_one():
    events = [
        happened(EventKind.NEW, 0, 1),
        happened(EventKind.RECOGNIZED, 7, 3),
        happened(EventKind.REFUSED, 5, 0),
        happened(EventKind.FOLLOWED, 3, 1),
        happened(EventKind.RELOCALISED, 9, 7),
    ]
    assert same_in_the_end(events[:-1]) == {7: 1, 3: 1}
    assert same_in_the_end([*events[:2], happened(EventKind.RELOCALISED, 9, 3)]) == {7: 3, 9: 3}


def test_the_ring_is_learned(ring: World, once_round: PlacedTour):
    rooms = once_round.rooms(ring)
    assert sorted(rooms.values(), key=sorted) == [frozenset({f"P{k}"}) for k in range(1, 7)]
    assert once_round.is_right(ring)


def test_a_wrong_network_is_not_right(ring: World, once_round: PlacedTour):
    everywhere = replace(once_round, places=np.zeros_like(once_round.places))
    assert everywhere.rooms(ring) == {0: frozenset(f"P{k}" for k in range(1, 7))}
    assert not everywhere.is_right(ring)
    places = once_round.places.copy()
    places[np.flatnonzero(places == 2)[8]] = 1
    assert not replace(once_round, places=places).is_right(ring)
    # One room twice, and two exits that were not gone through.
    assert not replace(once_round, places=np.arange(len(places))).is_right(ring)
    assert not once_round.is_right(load_world("office-double"))


def test_every_crossing_is_that_of_a_true_exit(once_round: PlacedTour):
    assert [each.exit for each in once_round.crossings] == ["E1", "E2", "E3", "E4", "E5", "E6"]
    assert sorted(once_round.frames) == list(range(7))  # P1 again was a seventh at first.
    starts = [once_round.journey.truth[crossing.view] for crossing in once_round.crossings]
    np.testing.assert_array_equal([once_round.frames[k] for k in range(1, 7)], starts)
    for crossing in once_round.crossings:
        doorway = 0.5 * np.hypot(*(crossing.seen[2:] - crossing.seen[:2]))
        assert 0.3 < doorway < 0.7
        away = np.hypot(*(once_round.poses[crossing.view, :2] - crossing.seen[:2]))
        assert away < 2.0


def test_only_a_mapper_of_places_can_be_judged(ring: World, once_round: PlacedTour):
    with pytest.raises(InputError, match="one of Albot1's, found odometry"):
        place_tour("odometry", ring, once_round.journey)


def test_distance_of_lines_is_that_of_their_middles():
    assert between(np.array([0.0, 0.0, 2.0, 0.0]), np.array([4.0, 3.0, 4.0, 5.0])) == 5.0


def test_a_loop_begins_anywhere_and_closes(ring: World):
    loop = ring.tours["single-loop"]
    whole = c1.loop_from(loop, 0)
    assert np.array_equal(whole[: len(loop)], loop)
    assert np.array_equal(whole[-1], loop[1])
    other = c1.loop_from(loop, 6)
    assert np.array_equal(other[0], loop[6])
    assert np.array_equal(other[len(loop) - 1], loop[6])
    assert len(np.unique(other, axis=0)) == len(loop) - 1


def test_a_story_leaves_out_what_was_refused():
    events = [
        happened(EventKind.SET_OUT, 0, -1),
        happened(EventKind.NEW, 0, 1),
        happened(EventKind.REFUSED, 1, 0),
    ]
    assert c2.story(events) == ((EventKind.NEW, "P1", "P2"),)


class Told(Albot1):
    """A mapper whose network has some events."""

    told: tuple[Event, ...] = ()

    @property
    def events(self) -> tuple[Event, ...]:
        return self.told


@pytest.mark.parametrize(
    ("step", "place", "gate", "unchecked"),
    [
        (12, 6, 2, False),
        (30, 6, 2, True),  # It is far within by then.
        (12, 6, STANDS_WITHIN, True),  # The gate has no part in it.
        (12, 5, 2, True),  # Another place was compared.
    ],
)
def test_a_check_at_the_entrance_is_noticed(
    once_round: PlacedTour, step: int, place: int, gate: int, unchecked: bool
):
    entered = Event(step=10, kind=EventKind.NEW, place=5, other=6)
    compared = Event(step=step, kind=EventKind.REFUSED, place=place, other=0, gate=gate)
    mapper = Told()
    mapper.told = (entered, compared)
    assert c2.is_unchecked(replace(once_round, mapper=mapper)) == unchecked
    mapper.told = (compared,)
    assert not c2.is_unchecked(replace(once_round, mapper=mapper))  # P7 was never entered.


def test_new_events_are_those_after_the_last_known_even_where_old_ones_are_forgotten():
    log = EventLog(3, 0)
    before = tuple(log.events)
    assert new_events(before, tuple(log.events)) == ()
    for step in (1, 1, 2):
        log.add(Event(step=step, kind=EventKind.NEW, place=0, other=1))
        before, known = tuple(log.events), before
        assert new_events(known, before) == (before[-1],)
    for _ in range(2):
        log.add(Event(step=3, kind=EventKind.NEW, place=0, other=1))
    assert len(log.events) == 3
    assert new_events(before, tuple(log.events)) == tuple(log.events[1:])


def test_the_disturbance_may_change_between_the_laps(ring_journey: TourRecord):
    moved = c3.disturbed(ring_journey, (2.0, 1.0))
    added = [
        after.motion - before.motion
        for before, after in zip(ring_journey.readings, moved.readings, strict=True)
    ]
    half = len(added) // 2
    np.testing.assert_array_equal(added[0], np.zeros(3))
    np.testing.assert_allclose(added[1:half], np.tile(2 * DISTURBANCE, (half - 1, 1)))
    np.testing.assert_allclose(added[half:], np.tile(DISTURBANCE, (len(added) - half, 1)))


def test_an_exit_is_nearer_if_it_is_near_and_nearer_than_the_unaligned_one(
    once_round: PlacedTour,
):
    aligned = np.array([0.29, 0.31, 0.2, np.inf, 0.0, 0.1])
    unaligned = np.array([1.0, 1.0, 0.39, np.inf, 0.0, np.inf])
    lap = c3.SecondLap(placed=once_round, aligned=aligned, unaligned=unaligned)
    assert c3._is_nearer([lap]).tolist() == [True, False, False, False, True, True]


def test_a_second_lap_is_held_against_the_first(once_round: PlacedTour):
    line = np.array([0.0, -0.5, 0.0, 0.5])
    nowhere = np.full(4, np.nan)
    late = len(once_round.poses) - 1
    crossings = (
        Crossing(view=3, exit="E1", seen=line, expected=nowhere),
        Crossing(view=9, exit="E2", seen=line, expected=nowhere),
        Crossing(view=late - 2, exit="E1", seen=line + 3.0, expected=line + 2.0),
        Crossing(view=late - 1, exit="E2", seen=line + 4.0, expected=nowhere),
        Crossing(view=late, exit="E1", seen=line, expected=line),
    )
    lap = c3.second_lap(replace(once_round, crossings=crossings))
    inf = np.inf
    assert lap.aligned == pytest.approx([2**0.5, inf, inf, inf, inf, inf])
    assert lap.unaligned == pytest.approx([18**0.5, 32**0.5, inf, inf, inf, inf])
    assert lap.drift < 0.5


def test_twice_round_is_a_lap_more(ring: World):
    loop = ring.tours["single-loop"]
    tour = c3.twice_round(loop)
    assert np.array_equal(tour[: len(loop)], loop)
    assert np.array_equal(tour[len(loop) - 1 : -1], loop)
    assert np.array_equal(tour[-1], loop[1])


@pytest.mark.parametrize("module", [c1, c2, c3])
def test_no_seeds_are_refused(module):
    with pytest.raises(InputError, match="at least one"):
        module.run(range(0))
