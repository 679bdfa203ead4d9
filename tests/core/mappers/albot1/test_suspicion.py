"""When the robot suspects that it is in a place it knows."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.memory import NEVER
from albot_core.mappers.albot1.network_state import rebuilt_network, stored_network
from albot_core.mappers.albot1.record import AROUND, Happening
from albot_core.mappers.albot1.suspicion import suspicions
from tests.core.mappers.albot1.building import RING, led


def test_places_that_an_exit_joins_are_not_one():
    walker = led([(1, 0), (1, 1)])
    network = walker.network
    needed = suspicions(network, walker.pose())
    config = network.config
    assert needed[0] == NEVER  # there is no visit 0
    assert needed[2] == NEVER  # next door
    assert needed[3] == NEVER  # here
    assert config.fewest_met <= needed[1] <= config.most_met


@pytest.mark.parametrize(("size", "expected"), [(0, 2), (20, 2), (50, 5), (500, 8)])
def test_larger_places_need_more_surfaces_to_be_suspected(size, expected):
    walker = led(RING)
    walker.network.sites[0].surfaces = np.full((size, 4), 100.0)
    assert suspicions(walker.network, walker.pose())[1] == expected


@pytest.mark.parametrize(
    ("drift", "learned", "known"), [(0.3, 0.0, True), (-1.0, 0.0, False), (-1.5, -1.4, True)]
)
def test_where_it_believes_to_stand_within_a_place_it_suspects_that(drift, learned, known):
    walker = led(RING)
    walker.drift = np.array([drift, 0.0, 0.0])
    network = walker.network
    network.displacement = np.array([learned, 0.0, 0.0])
    found = walker.looks(np.zeros(len(network.visits), np.int32))
    event = network.record.events[-1]
    assert (found, event.other, event.needed) == (known, 0, AROUND)
    assert event.what == (Happening.RECOGNIZED if known else Happening.REFUSED)
    # In a place that it knows, and as in the thesis, where it stands arouses no suspicion.
    if known:
        assert AROUND not in suspicions(network, walker.pose())
    letter = led(RING, PlacesConfig.thesis())
    assert AROUND not in suspicions(letter.network, letter.pose())


def test_what_is_met_again_speaks_louder_than_where_it_stands():
    walker = led(RING)
    walker.network.sites[0].surfaces = walker.network.sites[0].surfaces[:3]
    assert suspicions(walker.network, walker.pose())[1] == AROUND
    assert not walker.recognize()
    event = walker.network.record.events[-1]
    assert (event.what, event.met, event.needed) == (Happening.REFUSED, 20, 2)
    walker.go((-1, 0))  # It may have been that place, seen through the door.
    assert walker.network.record.glimpsed() == {0}


def test_in_a_new_visit_it_looks_at_once_and_where_it_looked_is_remembered():
    walker = led(RING)
    walker.network.sites[0].surfaces = np.empty((0, 4))
    assert not walker.recognize()
    again = rebuilt_network(stored_network(walker.network), walker.network.config)
    np.testing.assert_array_equal(again.looked_from, walker.pose())
    walker.go((0, 1))
    assert np.isnan(walker.network.looked_from).all()
    again = rebuilt_network(stored_network(walker.network), walker.network.config)
    assert np.isnan(again.looked_from).all()
