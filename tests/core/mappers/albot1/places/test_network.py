"""The network of places in a scripted building, and its laws on random walks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, transform_segments
from albot_core.mappers.albot1.places import merging
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.network_state import NETWORK, rebuilt_network, stored_network
from albot_core.mappers.albot1.places.network_view import Network
from albot_core.mappers.albot1.places.place import LearnedExit, LearnedPlace
from albot_core.mappers.albot1.places.relocalisation import relocalise
from tests.core.mappers.albot1.building import (
    RING,
    SIDE,
    Room,
    Walker,
    check_links,
    door_between,
    happened,
    led,
)


def test_the_first_place_is_where_the_robot_sets_out():
    network = Walker().network
    assert (network.current, list(network.places)) == (0, [0])
    assert network.home.tolist() == [0, 0, 0]
    snapshot = network.snapshot()
    assert (snapshot.current, snapshot.home, snapshot.links) == (0, 0, ())


def test_a_reading_matches_the_one_taken_nearest_by_on_an_earlier_stay():
    walker, nothing = Walker(), np.empty((0, 4))
    network = walker.network
    for reading, x in enumerate((0.5, 1.0, 1.5), start=1):
        network.reading = reading
        network.drop_breadcrumb(np.array((x, 0.0, 0.0)), nothing)
    assert network.match_reading(np.array((1.0, 0.0, 0.0))) is None
    network.reading = 10
    walker.go((1, 0))
    assert network.match_reading(walker.pose()) is None
    network.reading = 20
    walker.go((0, 0))
    network.reading = 21
    network.drop_breadcrumb(np.array((0.9, 0.4, 0.0)), nothing)
    matched = [network.match_reading(np.array((x, 0.1, 0.0))) for x in (0.0, 0.6, 1.1, 9.0)]
    assert matched == [0, 1, 2, 3]
    assert [network.place_at(reading) for reading in (0, 9, 10, 19, 20, 99)] == [0, 0, 1, 1, 0, 0]
    network.breadcrumbs.clear()
    network.breadcrumbs.drop(0, np.zeros(3), nothing, 30)
    assert network.match_reading(np.zeros(3)) == 5  # Halfway through the first stay.


def test_an_exit_leads_there_and_back():
    walker = Walker()
    walker.go((1, 0))
    walker.go((0, 0))
    walker.go((1, 0))
    assert happened(walker) == [
        (EventKind.SET_OUT, 0, -1),
        (EventKind.NEW, 0, 1),
        (EventKind.ENTERED, 1, 0),
        (EventKind.ENTERED, 0, 1),
    ]
    check_links(walker.network)
    network = walker.network.snapshot()
    assert network.links == ((0, 1),)
    for place, room in ((0, (0, 0)), (1, (1, 0))):
        (door,) = network.place(place).exits
        line = transform_segments(network.place(place).frame, door.line[None])[0]
        other = (1 - room[0], 0)
        np.testing.assert_allclose(line, door_between(room, other), atol=1e-9)
        assert len(network.place(place).surfaces) == 10
    with pytest.raises(KeyError):
        network.place(7)


def test_a_ring_is_closed_when_structure_says_so():
    walker = led(RING)
    assert walker.network.current == 4
    assert walker.recognize()
    check_links(walker.network)
    network = walker.network.snapshot()
    assert [place.id for place in network.places] == [0, 1, 2, 3]
    assert network.links == ((0, 1), (0, 3), (1, 2), (2, 3))
    assert network.current == 0
    event = walker.network.log.events[-1]
    assert (event.kind, event.place, event.other) == (EventKind.RECOGNIZED, 4, 0)
    assert event.matches == 10
    assert event.left + event.right == 10
    # The number of a place that was found to be another is not used again.
    walker.go((-1, 0))
    assert walker.network.current == 5


def test_a_room_of_other_structure_is_refused():
    walker = led(RING)
    before = walker.network.snapshot()
    walker.room = (9, 9)
    walker.rooms[1] = (9, 9)  # its walls are met again, but not those of where it set out
    walker.drift = np.array([-72.0, -72.0, 0.0])
    assert not walker.recognize()
    assert walker.network.log.events[-1].kind == EventKind.REFUSED
    assert walker.network.snapshot().links == before.links


def test_drift_is_taken_out_where_a_place_is_recognised():
    walker, drift = Walker(), np.array([0.15, -0.2, np.radians(2.0)])
    for room in RING:
        walker.go(room, drift)
    assert walker.recognize()
    # Home is where the building has it, in the map as it is now.
    np.testing.assert_allclose(walker.network.home, walker.drift, atol=0.02)
    np.testing.assert_allclose(walker.network.frame, walker.drift, atol=0.02)


def test_an_exit_that_two_places_share_makes_one_of_what_it_leads_to():
    walker = led(RING)
    # Not recognised on coming home, the robot goes on round the ring: P5 is home, P6 is P2, …
    for room in RING[:2]:
        walker.go(room)
    assert len(walker.network.places) == 7
    assert walker.recognize()  # P7 is P3: then P6 is P2, and P5 is P1
    followed = [e for e in happened(walker) if e[0] == EventKind.FOLLOWED]
    assert followed == [(EventKind.FOLLOWED, 5, 1), (EventKind.FOLLOWED, 4, 0)]
    check_links(walker.network)
    assert walker.network.snapshot().links == ((0, 1), (0, 3), (1, 2), (2, 3))
    assert walker.network.current == 2
    # The visits to all of them are visits to those that they are.
    assert walker.network.visits == [-1, 0, 1, 2, 3, 0, 1, 2]


def test_readings_of_a_place_that_was_another_are_readings_of_that_one():
    walker = Walker()
    for reading, room in enumerate(RING, start=1):
        walker.network.reading = 10 * reading
        walker.go(room)
    assert [walker.network.place_at(reading) for reading in (5, 15, 25, 35, 45)] == [0, 1, 2, 3, 4]
    assert walker.recognize()
    assert [walker.network.place_at(reading) for reading in (5, 15, 25, 35, 45)] == [0, 1, 2, 3, 0]


@pytest.mark.parametrize("one_pass", ["_unite_exits", "_drop_double"])
def test_a_merge_ends_although_no_pass_removes_anything(monkeypatch, one_pass):
    """No more passes than there are places and exits, whatever each of them says."""
    walker = led(RING)
    exits = sum(len(place.exits) for place in walker.network.places.values())
    most, passes = len(walker.network.places) * (len(walker.network.places) + exits), []

    def removes_nothing(*_):
        passes.append(1)
        assert len(passes) <= most
        return True

    monkeypatch.setattr(merging, one_pass, removes_nothing)
    assert walker.recognize()
    assert passes
    assert walker.network.current == 0


def test_one_door_learned_twice_becomes_one_exit():
    # A map that drifts by more than is expected between two uses of one door has it twice.
    walker, jump = Walker(), np.array([0.0, 1.2, 0.0])
    walker.go((1, 0))
    walker.go((0, 0), jump)
    assert walker.network.current == 2
    walker.network.map_to_graph = walker.drift
    assert walker.recognize()
    check_links(walker.network)
    assert len(walker.network.places) == 2


@st.composite
def walks(draw: st.DrawFn) -> tuple[list[Room], list[bool]]:
    """A walk over the doors of a random building, and where the robot tries to recognise."""
    pairs = [((c, r), (c + 1, r)) for c in range(3) for r in range(3)]
    pairs += [((r, c), (r, c + 1)) for c in range(3) for r in range(3)]
    kept = [pair for pair in pairs if draw(st.integers(0, 3))] or pairs[:1]
    doors: dict[Room, list[Room]] = {}
    for one, other in kept:
        doors.setdefault(one, []).append(other)
        doors.setdefault(other, []).append(one)
    room, walk = (0, 0), []
    for _ in range(draw(st.integers(1, 15))):
        room = draw(st.sampled_from(doors.get(room, [room])))
        walk.append(room)
    return walk, [draw(st.booleans()) for _ in walk]


@settings(max_examples=25, deadline=None)
@given(walks())
def test_in_a_map_without_drift_the_network_is_the_building(walk):
    walker = Walker()
    entered = {(0, 0): 0}
    doors = set()
    for room, _ in zip(*walk, strict=True):
        if room == walker.room:
            return
        doors.add(frozenset((walker.room, room)))
        walker.go(room)
        known = room in entered and walker.network.current == entered[room]
        if room in entered and not known:
            assert walker.recognize(), walker.network.log.events[-1]
        entered.setdefault(room, walker.network.current)
        assert walker.network.current == entered[room]
        check_links(walker.network)
    expected = {frozenset(entered[room] for room in pair) for pair in doors}
    assert {frozenset(pair) for pair in walker.network.snapshot().links} == expected
    assert len(walker.network.places) == len(entered)


@settings(max_examples=25, deadline=None)
@given(walks(), st.integers(0, 10**6), st.floats(0, 0.5))
def test_links_are_symmetrical_whatever_the_map_does(walk, seed, noise):
    walker, rng = Walker(), np.random.default_rng(seed)
    for room, tries in zip(*walk, strict=True):
        if room == walker.room:
            return
        walker.go(room, rng.normal(0, (noise, noise, 0.1 * noise)))
        if tries:
            walker.recognize()
        check_links(walker.network)
    stored = stored_network(walker.network)
    again = stored_network(rebuilt_network(stored, walker.network.config))
    for name, array in stored.items():
        np.testing.assert_array_equal(again[name], array)


def test_a_lost_robot_finds_itself_and_what_it_saw_meanwhile_stays_known():
    walker = led(RING[:3])
    network = walker.network
    before = len(network.places)
    # It is carried to (2, 1), which it has never seen, and believes to be where it was.
    carried = np.array([-2 * SIDE, 0.0, 0.0])
    network.start_anew(walker.step, walker.seen(), walker.pose())
    walker.room, walker.drift = (2, 1), carried
    walker.rooms.append((2, 1))
    assert network.lost_since
    assert len(network.places) == before + 1
    assert relocalise(network, walker.step, walker.sight()) is None
    unknown = network.current
    walker.go((1, 1))
    motion = relocalise(network, walker.step, walker.sight())
    assert motion is not None
    np.testing.assert_allclose(motion, -carried, atol=0.01)
    check_links(network)
    assert network.current == 2
    assert network.lost_since == 0
    assert [e[0] for e in happened(walker)[-3:]] == [
        EventKind.LOST,
        EventKind.NEW,
        EventKind.RELOCALISED,
    ]
    place = network.snapshot().place(unknown)
    (door,) = place.exits
    placed = transform_segments(compose(network.map_to_graph, place.frame), door.line[None])[0]
    np.testing.assert_allclose(placed, door_between((2, 1), (1, 1)), atol=0.02)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("ids", lambda a: a[::-1]),
        ("ids", lambda a: a + 1),
        ("frames", lambda a: a[:, :2]),
        ("frames", lambda a: np.full_like(a, np.nan)),
        ("sizes", lambda a: a + 1),
        ("sizes", lambda a: a * [-1, 1]),
        ("surfaces", lambda a: a[1:]),
        ("lines", lambda a: a[1:]),
        ("links", lambda a: a + np.array([100, 0])),
        ("links", lambda a: a + np.array([0, 100])),
        ("visits", lambda a: a[:-1]),
        ("visits", lambda a: np.append(a[:-1], 99)),
        ("displacements", lambda a: a[1:]),
        ("stays", lambda a: a[:0]),
        ("stays", lambda a: a + np.array([1, 0])),
        ("stays", lambda a: a + np.array([0, 100])),
        ("stays", lambda a: np.append(a, [[-1, 0]], axis=0)),
        ("standing", lambda a: a + 50),
        ("standing", lambda a: a * [1, 0, 1, 1]),
        ("standing", lambda a: a + np.array([0, 0, 99, 0])),
        ("displacement", lambda a: a * np.inf),
        ("events", lambda a: a[:, 1:]),
        ("events", lambda a: a + 30),
    ],
)
def test_damaged_arrays_are_refused(name, damage):
    walker = led([*RING, *RING[:2]])
    stored = stored_network(walker.network)
    with np.errstate(invalid="ignore"):
        kept = stored[f"places.{name}"]
        damaged = stored | {f"places.{name}": np.asarray(damage(kept), kept.dtype)}
    NETWORK.check(stored)
    with pytest.raises(InputError, match="places"):
        NETWORK.check(damaged)


def test_one_way_links_are_refused():
    walker = led([*RING, *RING[:2]])
    stored = stored_network(walker.network)
    stored["places.links"][[0, -1]] = stored["places.links"][[-1, 0]]
    with pytest.raises(InputError, match="links"):
        NETWORK.check(stored)


def test_a_place_holds_what_is_not_seen_through_its_exits():
    place = LearnedPlace(id=0, frame=np.zeros(3))
    place.exits.append(LearnedExit(line=np.array([2.0, -0.5, 2.0, 0.5]), leads_to=1, exit_there=0))
    assert place.exit_at(np.array([2.3, -0.5, 2.3, 0.5])) == 0
    assert place.exit_at(np.array([2.9, -0.5, 2.9, 0.5])) is None
    # From the other side it is another exit.
    assert place.exit_at(np.array([2.0, 0.5, 2.0, -0.5])) is None
    inside, outside = [(0.0, 0.0), (1.9, 3.0), (5.0, 40.0)], [(2.5, 0.0), (4.0, 3.0)]
    assert all(place.holds(np.array(point)) for point in inside)
    assert not any(place.holds(np.array(point)) for point in outside)


def test_a_place_knows_its_middle():
    walker = Walker()
    walker.go((1, 0))
    walker.go((1, 1))
    network = walker.network.snapshot()
    doors = [door_between((1, 0), other).reshape(2, 2).mean(0) for other in ((0, 0), (1, 1))]
    np.testing.assert_allclose(network.place(1).middle, np.mean(doors, axis=0), atol=1e-9)
    assert Network().links == ()
