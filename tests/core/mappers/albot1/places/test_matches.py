"""How sure Albot1 is of the place that it recognises."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import relative
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.events import Event, EventKind
from albot_core.mappers.albot1.places.matches import match_place, share_explained
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.sensing.reading import Reading
from tests.core.scenes import FURNITURE, house_walk, scan_from, two_rooms

ROOM = np.array([[0.0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]])


@pytest.mark.parametrize(
    ("view", "share"),
    [
        (ROOM, 1.0),
        (ROOM + 0.2, 1.0),
        (ROOM + 5.0, 0.0),
        (np.concatenate((ROOM, ROOM + 9.0)), 0.5),
        # Half of this wall reaches beyond the room.
        (np.array([[0.0, 0, 8, 0]]), 0.6),
        (np.empty((0, 4)), 0.0),
    ],
)
def test_the_share_of_a_view_that_a_place_explains(view: np.ndarray, share: float) -> None:
    still = np.zeros(3)
    assert share_explained(view, still, still, ROOM) == pytest.approx(share)


def test_it_does_not_matter_where_the_place_lies() -> None:
    """The robot 1 m along in a place whose frame is turned by a right angle."""
    frame = np.array((2.0, 3.0, np.pi / 2))
    pose = np.array((2.0, 4.0, np.pi / 2))
    view = ROOM - np.array((1.0, 0.0, 1.0, 0.0))
    assert share_explained(view, pose, frame, ROOM) == pytest.approx(1.0)


def test_a_new_place_has_no_match_and_a_known_one_its_earlier_stays() -> None:
    network = PlaceNetwork(PlacesConfig())
    pose = np.zeros(3)
    assert match_place(network, pose, ROOM, 3).shape == (0, 6)
    for reading, x in ((5, 1.0), (9, 2.0)):
        network.reading = reading
        network.drop_breadcrumb(np.array((x, 0.0, 0.0)), np.empty((0, 4)))
    network.here.surfaces = ROOM
    # Away and back again: a second stay in the same place, then a third.
    for first in (20, 30):
        network.visits += [7, 0]
        network.stays += [(first, 7), (first + 5, 0)]
        network.reading = first + 6
        network.drop_breadcrumb(np.array((3.0, 0.0, 0.0)), np.empty((0, 4)))
    found = match_place(network, np.array((2.6, 0.0, 0.0)), ROOM - [2.6, 0, 2.6, 0], 3)
    assert found[:, 5].tolist() == [26.0, 9.0]
    assert found[:, 3].tolist() == [3.0, 2.0]
    assert found[:, 0] == pytest.approx(1.0)
    assert found[:, 1].tolist() == [1.0, 1.0]
    assert found[:, 2].tolist() == [0.0, 0.0]
    assert len(match_place(network, pose, ROOM, 1)) == 1
    # A comparison in this stay counts, one of an earlier stay does not.
    kinds = (EventKind.REFUSED, 0.7), (EventKind.ENTERED, 0.0), (EventKind.REFUSED, 0.3)
    for kind, probability in (*kinds, (EventKind.RECOGNIZED, 0.8)):
        event = Event(step=1, kind=kind, place=0, other=1, probability=probability)
        network.log.add(event)
    assert match_place(network, pose, ROOM, 1)[0, 1:3].tolist() == [0.8, 0.3]


def test_a_walk_through_two_rooms_and_back() -> None:
    mapper = Albot1()
    walls = np.concatenate((two_rooms(), FURNITURE))
    seen = []
    before = None
    for number, pose in enumerate(house_walk()):
        motion = np.zeros(3) if before is None else relative(before, pose)
        scan = scan_from(pose, walls)
        mapper.update(Reading(stamp=float(number), motion=motion, laser=scan))
        seen.append(mapper.place_matches(3))
        before = pose
    for number, matches in enumerate(seen):
        assert (matches[:, :3] >= 0).all()
        assert (matches[:, :3] <= 1).all()
        assert (matches[:, 5] <= number).all()
    assert not len(seen[0])
