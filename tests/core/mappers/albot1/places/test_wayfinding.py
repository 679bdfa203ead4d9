"""Ways over the network of places, against networkx's shortest paths."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_segments
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import middle
from albot_core.mappers.albot1.places.wayfinding import CROSSING, pointing, route, way_lines
from tests.core.mappers.albot1.building import Walker, door_between


def wandering(turns: list[int]) -> Walker:
    """A robot that has been about a building of 3 x 3 rooms and knew each room again."""
    walker = Walker()
    entered = {(0, 0): 0}
    for turn in turns:
        c, r = walker.room
        around = [(c + 1, r), (c - 1, r), (c, r + 1), (c, r - 1)]
        near = [room for room in around if min(room) >= 0 and max(room) < 3]
        walker.go(near[turn % len(near)])
        if walker.network.current != entered.setdefault(walker.room, walker.network.current):
            assert walker.recognize()
    return walker


def graph_of(network: PlaceNetwork, start: np.ndarray, goal: np.ndarray, target: int) -> nx.Graph:
    """Exits as nodes; edges are the ways across a place, and through a door."""
    graph = nx.Graph()
    for key, place in network.places.items():
        ends = {(key, k): middle(p.line) for k, p in enumerate(place.exits)}
        if key == network.current:
            ends["start"] = start
        if key == target:
            ends["goal"] = goal
        for one, a in ends.items():
            for other, b in ends.items():
                if one != other:
                    graph.add_edge(one, other, weight=float(np.hypot(*(a - b))))
        for k, door in enumerate(place.exits):
            there = (door.leads_to, door.exit_there)
            graph.add_edge((key, k), there, weight=CROSSING)
    return graph


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(0, 11), max_size=14), st.integers(0, 99), *2 * [st.floats(-3, 3)])
def test_the_way_is_as_short_as_networkx_finds_it(turns, which, x, y):
    walker = wandering(turns)
    network, pose, goal = walker.network, walker.pose(0.4), np.array((x, y))
    target = sorted(network.places)[which % len(network.places)]
    way = route(network, pose, target, goal)
    if target == network.current:
        assert way == []
        return
    start = relative(network.frame, pose)[:2]
    graph = graph_of(network, start, goal, target)
    shortest = nx.dijkstra_path_length(graph, "start", "goal")
    at, place, length = start, network.current, 0.0
    for step_place, index in way:
        assert step_place == place
        door = network.places[place].exits[index]
        length += float(np.hypot(*(middle(door.line) - at))) + CROSSING
        place = door.leads_to
        at = middle(network.places[place].exits[door.exit_there].line)
    assert place == target
    assert length + np.hypot(*(goal - at)) == pytest.approx(shortest)


def test_the_way_is_told_by_the_exits_where_they_lie_in_the_map():
    walker, drift = Walker(), np.array([0.3, 0.2, 0.1])
    for room in ((1, 0), (1, 1)):
        walker.go(room)
    walker.network.map_to_graph = walker.drift = drift
    lines = way_lines(walker.network, walker.pose(), 0)
    doors = np.array([door_between((1, 1), (1, 0)), door_between((1, 0), (0, 0))])
    np.testing.assert_allclose(lines, transform_segments(drift, doors), atol=1e-9)
    assert way_lines(walker.network, walker.pose(), 2).shape == (0, 4)


def test_a_place_that_no_exit_leads_to_has_no_way():
    walker = Walker()
    walker.go((1, 0))
    walker.network.start_anew(9, walker.seen(), walker.pose())
    assert route(walker.network, walker.pose(), 0) == []
    assert way_lines(walker.network, walker.pose(), 0).shape == (0, 4)


def test_pointing_is_a_direction_and_a_distance():
    walker = Walker()
    walker.go((1, 0))
    pose = np.array([8.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(pointing(walker.network, pose, 0), (np.pi / 2, 8.0))
    turn = np.array([1.0, 2.0, 0.7])
    walker.network.map_to_graph = turn
    moved = pointing(walker.network, compose(turn, pose), 0)
    np.testing.assert_allclose(moved, (np.pi / 2, 8.0))


def test_an_unknown_place_is_refused():
    network = Walker().network
    for ask in (way_lines, pointing):
        with pytest.raises(InputError, match=r"place.* one of 0"):
            ask(network, np.zeros(3), 5)
