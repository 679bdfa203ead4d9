"""Where the next place is laid at an exit, and who came out of a place unnoticed."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose, transform_segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.merging import merge_here
from albot_core.mappers.albot1.places.network_state import rebuilt_network, stored_network
from albot_core.mappers.albot1.places.place import (
    SAME_EXIT,
    LearnedExit,
    LearnedPlace,
    drift_after,
    middle,
    reversed_line,
)
from tests.core.mappers.albot1.building import check_links, door_between, happened, led


def test_who_comes_out_of_a_place_had_left_the_other_unnoticed():
    walker = led([(1, 0), (0, 0)])
    described = walker.network.places[0].surfaces.copy()
    walker.room = (1, 0)  # through the door, but the network was not told
    walker.go((0, 0))
    assert happened(walker)[-1] == (EventKind.RETURNED, 0, 1)
    check_links(walker.network)
    assert (walker.network.current, len(walker.network.places)) == (0, 2)
    assert walker.network.visits == [-1, 0, 1, 0, 0]
    np.testing.assert_array_equal(walker.network.places[0].surfaces, described)
    # In the thesis it leaves the place that it believes to be in, by an exit not known.
    thesis = led([(1, 0), (0, 0)], PlacesConfig.thesis())
    thesis.room = (1, 0)
    thesis.go((0, 0))
    assert happened(thesis)[-1] == (EventKind.NEW, 0, 2)


def test_who_went_next_door_unnoticed_comes_out_of_it_by_another_exit():
    walker = led([(1, 0), (1, 1), (1, 0), (0, 0)])
    walker.room = (1, 0)  # through the door, but the network was not told
    walker.go((1, 1))
    assert happened(walker)[-1] == (EventKind.RETURNED, 2, 1)
    check_links(walker.network)
    assert (walker.network.current, len(walker.network.places)) == (2, 3)
    thesis = led([(1, 0), (1, 1), (1, 0), (0, 0)], PlacesConfig.thesis())
    thesis.room = (1, 0)
    thesis.go((1, 1))
    assert happened(thesis)[-1] == (EventKind.NEW, 0, 3)


@pytest.mark.parametrize(
    ("drift", "kind"), [(0.7, EventKind.ENTERED), (0.9, EventKind.ENTERED), (1.3, EventKind.NEW)]
)
def test_an_exit_is_known_as_far_off_as_the_map_may_have_drifted(drift, kind):
    """The room is entered by one door and left by another, 6 m on: 1.03 m may lie between."""
    walker = led([(1, 0), (1, 1), (1, 0)])
    assert walker.network.drift_at(np.array([3.7, 0.0, 0.0])) == pytest.approx(1.03, abs=0.01)
    walker.go((0, 0), np.array([0.0, drift, 0.0]))
    assert walker.network.log.events[-1].kind == kind
    check_links(walker.network)


def test_the_drift_expected_grows_with_the_way_and_not_with_the_distance():
    walker = led([(1, 0), (1, 1), (0, 1), (0, 0)])
    here = walker.pose()
    assert walker.network.drift_at(here) > 2.0  # Back where it set out, 25 m and more later.
    walker.network.begin_leg(here, is_aligned=True)
    assert walker.network.drift_at(here) == pytest.approx(SAME_EXIT)
    again = rebuilt_network(stored_network(walker.network), walker.network.config)
    far = np.array([30.0, 0.0, 0.0])
    assert again.drift_at(far) == walker.network.drift_at(far)
    thesis = led([(1, 0), (1, 1), (0, 1), (0, 0)], PlacesConfig.thesis())
    assert thesis.network.drift_at(here) == pytest.approx(SAME_EXIT)


AT = np.array([0.0, -0.5, 0.0, 0.5])
"""An exit at the origin."""


@pytest.mark.parametrize(
    ("exits", "others", "found"),
    [
        ([1.0], [], 0),
        ([1.6], [], None),  # no drift makes one doorway of two
        ([1.0, -1.5], [], None),  # it may be either
        ([1.0, -2.1], [], 0),
        ([1.0], [0.9], None),  # the exit known is seen beside it
        ([1.0], [0.1], 0),  # this one itself
        ([], [], None),
    ],
)
def test_the_likeliest_exit_is_so_by_far(exits, others, found):
    place = LearnedPlace(id=0, frame=np.zeros(3))
    shifts = [np.array([0.0, y, 0.0, y]) for y in exits]
    place.exits = [LearnedExit(line=AT + by, leads_to=1, exit_there=0) for by in shifts]
    seen = np.reshape([AT + np.array([0.0, y, 0.0, y]) for y in others], (-1, 4))
    assert place.likeliest_exit(AT, seen, drift_after(50.0)) == found
    assert place.likeliest_exit(AT, seen, drift_after(0.0)) is None
    assert place.likeliest_exit(reversed_line(AT), seen, drift_after(50.0)) is None


@pytest.mark.parametrize(
    ("apart", "beyond_apart", "left"),
    [(1.2, 1.2, 1), (1.6, 1.6, 2), (1.2, 4.0, 1), (4.0, 1.2, 1)],
)
def test_two_exits_so_near_on_either_side_between_the_same_places_are_one(
    apart, beyond_apart, left
):
    walker = led([(1, 0), (2, 0), (2, 1)])
    network = walker.network
    one, other = network.places[0], network.places[1]
    for place, beyond, away in ((one, other, apart), (other, one, beyond_apart)):
        door = next(door for door in place.exits if door.leads_to == beyond.id)
        by = np.array([0.0, away, 0.0, away])
        double = LearnedExit(line=door.line + by, leads_to=beyond.id, exit_there=len(beyond.exits))
        place.exits.append(double)
    one.exits[-1].exit_there = len(other.exits) - 1
    other.exits[-1].exit_there = len(one.exits) - 1
    check_links(network)
    merge_here(network, 9, one, np.array([16.0, 30.0, 0.0]), walker.pose())
    check_links(network)
    assert sum(door.leads_to == 1 for door in network.places[0].exits) == left


@pytest.mark.parametrize(
    ("shift", "turn", "moved"), [(0.3, 0.0, 0.0), (0.6, 0.0, 0.6), (0.6, 0.5, 0.0)]
)
def test_an_exit_lays_the_next_place_at_it_only_where_it_is_seen_well(shift, turn, moved):
    walker = led([(1, 0), (0, 0)])
    door = door_between((0, 0), (1, 0))
    at = middle(door)
    pose = np.array([at[0], at[1] + shift, turn])
    line = transform_segments(pose, door[None] - [*at, *at])[0]
    walker.network.remember_place(9, line, walker.seen(), np.array([4.3, shift, 0.0]))
    assert walker.network.current == 1
    np.testing.assert_allclose(walker.network.map_to_graph, [0, moved, 0], atol=1e-9)


@pytest.mark.parametrize(("learned", "seen", "laid"), [(-0.39, -0.41, -0.39), (-0.39, 0.39, 0.39)])
def test_what_is_remembered_and_what_is_seen_of_an_exit_do_not_add_up(learned, seen, laid):
    walker = led([(1, 0), (0, 0)])
    network, door = walker.network, door_between((0, 0), (1, 0))
    network.places[1].frame = network.places[1].frame + np.array([0.0, learned, 0.0])
    line = door + np.array([0.0, seen, 0.0, seen])
    network.remember_place(9, line, walker.seen(), np.array([4.3, seen, 0.0]))
    there = transform_segments(network.frame, network.here.exits[0].line[None])[0]
    np.testing.assert_allclose(middle(there)[1], laid, atol=1e-9)


@pytest.mark.parametrize(("shift", "turn"), [(0.05, 0.02), (0.3, 0.0), (0.0, 0.3), (-0.6, -0.5)])
def test_in_the_thesis_the_exit_crossed_is_the_reference_for_position_and_direction(shift, turn):
    walker = led([(1, 0), (1, 1), (1, 0), (0, 0)], PlacesConfig.thesis())
    network, door = walker.network, door_between((0, 0), (1, 0))
    at = middle(door)
    seen = np.array([at[0], at[1] + shift, turn])
    line = transform_segments(seen, door[None] - [*at, *at])[0]
    network.remember_place(9, line, walker.seen(), np.array([4.3, shift, 0.0]))
    assert network.log.events[-1].kind == EventKind.ENTERED
    # All exits of the next place are where they are from the exit crossed.
    expected = door_between((1, 0), (1, 1))
    others = transform_segments(seen, np.array([reversed_line(door), expected]) - [*at, *at])
    np.testing.assert_allclose(network.predicted_exits, others, atol=1e-9)


def test_places_are_laid_together_at_the_exit_that_both_remember():
    """A map that has drifted between them holds two places apart in the graph frame."""
    walker = led([(1, 0), (0, 0)])
    network = walker.network
    network.places[1].frame = network.places[1].frame + np.array([0.0, 1.0, 0.0])
    walker.go((1, 0))
    exits = [
        transform_segments(compose(network.map_to_graph, place.frame), place.exits[0].line[None])
        for place in network.places.values()
    ]
    np.testing.assert_allclose(middle(exits[1][0]), middle(door_between((0, 0), (1, 0))), atol=1e-9)
    # And back again, to where it was.
    walker.go((0, 0))
    np.testing.assert_allclose(network.map_to_graph, np.zeros(3), atol=1e-9)
