"""A robot that was carried away stays lost until one place alone explains what it sees."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.network_state import rebuilt_network, stored_network
from albot_core.mappers.albot1.places.place import LearnedPlace
from albot_core.mappers.albot1.places.relocalisation import Sight, relocalise
from tests.core.mappers.albot1.building import walls_of

ROOM = walls_of((0, 0))
ANNEX = walls_of((1, 1)) - np.array([2.0, 8.0, 2.0, 8.0])
"""Ten walls 6 m beside those of ROOM."""
NOTHING = np.empty((0, 4))
APART = np.array([40.0, 0.0, 0.5])
"""Where the second place's frame lies in the graph frame."""
CARRIED = np.array([3.0, -2.0, 1.0])
"""Where the frame of the place in which it is put down lies in the map."""


def lost_among(first: np.ndarray, second: np.ndarray) -> PlaceNetwork:
    """A robot that knows two places by their walls, and was carried away from the second.

    It believes what it sees at first sight.
    """
    network = PlaceNetwork(PlacesConfig(confirming_distance=0.0))
    network.places[0].surfaces = first
    network.places[1] = LearnedPlace(id=1, frame=APART, surfaces=second)
    network.visits, network.visit_transforms = [-1, 0, 1], [np.zeros(3)] * 3
    network.current, network.next_id = 1, 2
    network.drop_breadcrumb(APART, NOTHING)
    network.start_anew(1, NOTHING, APART)
    return network


def sees(walls: np.ndarray) -> Sight:
    """Standing at the origin of a place's frame, it sees these walls of the place."""
    seen = transform_segments(CARRIED, walls)
    return Sight(seen=seen, view=seen, pose=CARRIED)


def probabilities(network: PlaceNetwork) -> dict[int, float]:
    """The probability of the likeliest hypothesis of each place."""
    return {
        key: max(one.probability for one in network.hypotheses if one.place == key)
        for key in (0, 1)
    }


def test_a_room_that_is_the_only_one_of_its_kind_is_recognised():
    network = lost_among(ROOM, walls_of((1, 0)))
    motion = relocalise(network, 5, sees(ROOM))
    assert motion is not None
    np.testing.assert_allclose(motion, inverse(CARRIED), atol=1e-6)
    assert (network.current, network.lost_since, network.hypotheses) == (0, 0, ())
    event = network.log.events[-1]
    assert (event.kind, event.other, event.matches) == (EventKind.RELOCALISED, 0, 10)
    assert event.probability >= PlacesConfig().min_probability


def test_in_one_of_two_equal_rooms_it_is_lost_until_it_sees_what_tells_them_apart():
    network = lost_among(ROOM, np.concatenate((ROOM, ANNEX)))
    assert relocalise(network, 5, sees(ROOM)) is None
    assert network.lost_since
    found = probabilities(network)
    assert 0.3 < found[0] < 0.6
    assert 0.3 < found[1] < 0.6
    motion = relocalise(network, 6, sees(np.concatenate((ROOM, ANNEX))))
    assert motion is not None
    np.testing.assert_allclose(motion, compose(APART, inverse(CARRIED)), atol=1e-6)
    assert network.current == 1


def test_one_room_that_looks_alike_from_two_sides_is_ambiguous_too():
    turned = np.array([9.0, 4.0, np.pi])
    both = np.concatenate((ROOM, transform_segments(turned, ROOM)))
    network = lost_among(both, walls_of((1, 0)))
    assert relocalise(network, 5, sees(ROOM)) is None
    assert probabilities(network)[0] < 0.6


def test_on_unknown_ground_nothing_is_probable():
    network = lost_among(ROOM, walls_of((1, 0)))
    assert relocalise(network, 5, sees(ANNEX)) is None
    assert sum(one.probability for one in network.hypotheses) < 0.5
    assert network.lost_since


def test_where_it_has_never_been_in_sight_of_its_way_it_stays_lost():
    # All walls match, but a known wall parts it from all breadcrumbs.
    wall = np.array([[-0.5, -9.0, -0.5, 9.0]])
    network = lost_among(np.concatenate((ROOM, wall)), walls_of((1, 0)))
    network.breadcrumbs.points[0] = -3.0, 0.0
    sight = sees(np.concatenate((ROOM, wall)))
    assert relocalise(network, 5, sight) is None
    assert probabilities(network)[0] > PlacesConfig().min_probability
    network.breadcrumbs.points[0] = 0.5, 0.0
    assert relocalise(network, 6, sight) is not None


def test_what_it_knows_to_be_free_has_no_wall():
    across = np.array([[x, -1.0, x, 1.0] for x in np.arange(-8.0, 9.0, 2.0)])
    sight = sees(np.concatenate((ROOM, across)))
    assert relocalise(lost_among(ROOM, walls_of((1, 0))), 5, sight) is not None
    network = lost_among(ROOM, walls_of((1, 0)))
    for x in (-9.0, 9.0):
        network.breadcrumbs.drop(0, np.array([x, 0.0, 0.0]), NOTHING)
    assert relocalise(network, 5, sight) is None
    assert max(one.across for one in network.hypotheses) >= 8


@pytest.mark.parametrize(("bar", "is_found"), [(0.999, False), (0.0, True)])
def test_the_probability_asked_for_is_the_configured_one(bar, is_found):
    network = lost_among(ROOM, walls_of((1, 0)))
    network.config = PlacesConfig(
        min_probability=min(bar, 0.9), min_relocalise_probability=bar, confirming_distance=0.0
    )
    assert (relocalise(network, 5, sees(ROOM)) is not None) == is_found


def seen_from(spot: tuple[float, float], walls: np.ndarray) -> Sight:
    """Standing elsewhere in a place's frame, it sees these walls of the place."""
    seen = transform_segments(CARRIED, walls)
    return Sight(seen=seen, view=seen, pose=compose(CARRIED, np.array([*spot, 0.3])))


def test_it_believes_only_what_a_look_from_elsewhere_confirms():
    network = lost_among(ROOM, walls_of((1, 0)))
    network.config = PlacesConfig(confirming_distance=2.0)
    assert relocalise(network, 5, sees(ROOM)) is None
    assert network.first_look is not None and network.lost_since
    np.testing.assert_array_equal(network.first_look[3:], CARRIED)
    assert relocalise(network, 6, seen_from((1.65, -0.94), ROOM)) is None
    np.testing.assert_array_equal(network.first_look[3:], CARRIED)
    motion = relocalise(network, 7, seen_from((1.82, -1.05), ROOM))
    assert motion is not None
    np.testing.assert_allclose(motion, inverse(CARRIED), atol=1e-6)
    assert network.first_look is None and not network.lost_since


def test_a_look_that_says_something_else_begins_anew():
    network = lost_among(ROOM, np.concatenate((ROOM, ANNEX)))
    network.config = PlacesConfig(confirming_distance=2.0)
    assert relocalise(network, 5, sees(np.concatenate((ROOM, ANNEX)))) is None
    first = network.first_look
    assert first is not None
    # Were the first look of another alignment, the next would be the first of its own.
    network.first_look = np.concatenate((first[:3] + np.array([2.0, 0.0, 0.0]), first[3:]))
    away = seen_from((1.82, -1.05), np.concatenate((ROOM, ANNEX)))
    assert relocalise(network, 6, away) is None
    np.testing.assert_array_equal(network.first_look[3:], away.pose)
    np.testing.assert_allclose(network.first_look[:3], first[:3], atol=1e-6)


def test_the_first_look_is_stored():
    network = lost_among(ROOM, walls_of((1, 0)))
    network.config = PlacesConfig(confirming_distance=2.0)
    relocalise(network, 5, sees(ROOM))
    again = rebuilt_network(stored_network(network), network.config)
    assert again.first_look is not None and network.first_look is not None
    np.testing.assert_array_equal(again.first_look, network.first_look)
    network.start_anew(8, NOTHING, CARRIED)
    assert network.first_look is None
    assert rebuilt_network(stored_network(network), network.config).first_look is None
