"""Which places are loop-closure candidates."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.perceptual_map.memory import NEVER
from albot_core.mappers.albot1.places.events import SEEN_THROUGH_EXIT, STANDS_WITHIN, EventKind
from albot_core.mappers.albot1.places.network_state import rebuilt_network, stored_network
from albot_core.mappers.albot1.places.recognition import candidate_gates
from tests.core.mappers.albot1.building import RING, led


def test_places_that_an_exit_joins_are_not_one():
    walker = led([(1, 0), (1, 1)])
    network = walker.network
    gates = candidate_gates(network, walker.pose())
    config = network.config
    assert gates[0] == NEVER  # there is no visit 0
    assert gates[2] == NEVER  # next door
    assert gates[3] == NEVER  # here
    assert config.min_reobserved <= gates[1] <= config.max_reobserved


@pytest.mark.parametrize(("size", "expected"), [(0, 2), (20, 2), (50, 5), (500, 8)])
def test_larger_places_need_more_surfaces_to_be_candidates(size, expected):
    walker = led(RING)
    walker.network.places[0].surfaces = np.full((size, 4), 100.0)
    assert candidate_gates(walker.network, walker.pose())[1] == expected


@pytest.mark.parametrize(
    ("drift", "learned", "is_aligned", "known"),
    [
        (0.3, 0.0, True, True),
        (-1.0, 0.0, True, False),
        (-1.0, 0.0, False, True),  # It has come 30 m since it was aligned: it may be so far off.
        (-1.5, -1.4, True, True),
    ],
)
def test_a_place_within_which_it_believes_to_stand_is_a_candidate(
    drift, learned, is_aligned, known
):
    walker = led(RING)
    if is_aligned:
        walker.network.begin_leg(walker.pose(), is_aligned=True)
    walker.drift = np.array([drift, 0.0, 0.0])
    network = walker.network
    network.map_to_graph = np.array([learned, 0.0, 0.0])
    found = walker.looks(np.zeros(len(network.visits), np.int32))
    event = network.log.events[-1]
    assert (found, event.other, event.gate) == (known, 0, STANDS_WITHIN)
    assert event.kind == (EventKind.RECOGNIZED if known else EventKind.REFUSED)
    # In a place that it knows, and as in the thesis, where it stands makes no candidate.
    if known:
        assert STANDS_WITHIN not in candidate_gates(network, walker.pose())
    letter = led(RING, PlacesConfig.thesis())
    assert STANDS_WITHIN not in candidate_gates(letter.network, letter.pose())


def test_what_is_met_again_speaks_louder_than_where_it_stands():
    walker = led(RING)
    walker.network.places[0].surfaces = walker.network.places[0].surfaces[:3]
    assert candidate_gates(walker.network, walker.pose())[1] == STANDS_WITHIN
    assert not walker.recognize()
    event = walker.network.log.events[-1]
    assert (event.kind, event.reobserved, event.gate) == (EventKind.REFUSED, 20, 2)
    walker.go((-1, 0))  # It may have been that place, seen through the door.
    assert walker.network.log.seen_through_exit() == {0}
    assert candidate_gates(walker.network, walker.pose())[1] == SEEN_THROUGH_EXIT


def test_in_the_thesis_what_was_seen_through_an_exit_must_be_met_again():
    walker = led(RING, PlacesConfig.thesis())
    walker.network.places[0].surfaces = walker.network.places[0].surfaces[:3]
    assert not walker.recognize()
    walker.go((-1, 0))
    assert walker.network.log.seen_through_exit() == {0}
    assert candidate_gates(walker.network, walker.pose())[1] == 2


def test_in_a_new_visit_it_looks_at_once_and_where_it_looked_is_remembered():
    walker = led(RING)
    walker.network.places[0].surfaces = np.empty((0, 4))
    assert not walker.recognize()
    again = rebuilt_network(stored_network(walker.network), walker.network.config)
    np.testing.assert_array_equal(again.compared_from, walker.pose())
    walker.go((0, 1))
    assert np.isnan(walker.network.compared_from).all()
    again = rebuilt_network(stored_network(walker.network), walker.network.config)
    assert np.isnan(again.compared_from).all()
