"""Whether two positions are one place: against shapely, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from albot_maps import Exit, Room, World, load_world
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


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ((2.0, 1.0), (4.0, 1.0), True),  # Nothing between.
        ((2.0, 1.0), (8.0, 1.0), False),  # The wall.
        ((4.8, 1.0), (5.2, 1.0), False),  # The wall, though near.
        ((4.0, 2.0), (6.0, 2.0), False),  # The doorway.
        ((4.8, 2.0), (5.2, 2.0), True),  # The doorway, but near.
    ],
)
def test_outside_all_rooms_only_walls_and_doorways_part(
    one: tuple[float, float], other: tuple[float, float], same: bool
) -> None:
    """That both are in no room makes them no more the same place than if they were in two."""
    walls = np.array([[0, 0, 10, 0], [10, 0, 10, 4], [10, 4, 0, 4], [0, 4, 0, 0], *MIDDLE], float)
    outlines = {"west": (0, 5), "east": (5, 10)}
    world = World(
        name="two-rooms",
        walls=walls,
        starts=np.array(((2.0, 2.0, 0.0),)),
        rooms=tuple(
            Room(name=name, boundary=np.array(((x0, 0), (x1, 0), (x1, 4), (x0, 4)), float))
            for name, (x0, x1) in outlines.items()
        ),
        exits=(Exit(name="door", segment=np.array((5, 1.5, 5, 2.5)), rooms=("west", "east")),),
    )
    outside = np.array((-1, -1))
    assert same_places(world, np.array((one, other)), outside)[0, 1] == same
