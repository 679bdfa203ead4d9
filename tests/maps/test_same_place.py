"""Whether two positions are one place: against shapely, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from albot_maps import World, load_world
from albot_maps.freespace import wall_lines
from albot_maps.same_place import DOORWAY, NEAR, same_places

OFFICE = load_world("office-ring")
MIDDLE = [5, 0, 5, 1.5], [5, 2.5, 5, 4]
"""The wall between the two rooms."""
PLACES = st.tuples(st.floats(0.5, 30), st.floats(0.5, 20))


def _room(world: World, x: float, y: float) -> int:
    name = world.room_at(x, y)
    return -1 if name is None else [room.name for room in world.rooms].index(name)


def _slowly(world: World, one: tuple[float, float], other: tuple[float, float]) -> bool:
    rooms = [_room(world, *place) for place in (one, other)]
    if rooms[0] == rooms[1] >= 0:
        return True
    way = shapely.LineString((one, other))
    if way.intersects(wall_lines(world.walls)):
        return False
    doors = [
        e.segment.reshape(2, 2)
        for e in world.exits
        if np.hypot(*(e.segment[2:] - e.segment[:2])) <= DOORWAY
    ]
    return way.length < NEAR or not any(way.intersects(shapely.LineString(d)) for d in doors)


@given(PLACES, PLACES)
def test_places_in_an_office_against_shapely(
    one: tuple[float, float], other: tuple[float, float]
) -> None:
    points = np.array((one, other))
    assume(all(wall_lines(OFFICE.walls).distance(shapely.Point(place)) > 0.01 for place in points))
    rooms = np.array([_room(OFFICE, x, y) for x, y in points.tolist()])
    same = same_places(OFFICE, points, rooms)
    assert same.diagonal().all()
    assert same[0, 1] == same[1, 0] == _slowly(OFFICE, one, other)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ((1.0, 1.0), (4.5, 3.5), True),  # The same room.
        ((4.7, 2.0), (5.3, 2.0), True),  # Either side of the doorway.
        ((4.0, 2.0), (6.0, 2.0), False),  # Through the doorway, but apart.
        ((4.8, 1.0), (5.2, 1.0), False),  # A wall between.
    ],
)
def test_by_hand(one: tuple[float, float], other: tuple[float, float], same: bool) -> None:
    """Two rooms of 5 m by 4 m, west and east, with a doorway of 1 m between them, not listed."""
    walls = np.array([[0, 0, 10, 0], [10, 0, 10, 4], [10, 4, 0, 4], [0, 4, 0, 0], *MIDDLE], float)
    two_rooms = World(name="two-rooms", walls=walls, starts=np.array(((2.0, 2.0, 0.0),)))
    rooms = np.array([int(x > 5) for x, _ in (one, other)])
    assert same_places(two_rooms, np.array((one, other)), rooms)[0, 1] == same
