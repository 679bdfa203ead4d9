"""Where the next place is laid at an exit, and who came out of a place unnoticed."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose, transform_segments
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.place import (
    middle,
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
