"""Rooms found by the compiled loop against those of the world."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_env.tasks.core.rooms import find_room, outlines_of
from albot_maps import World, load_world

OFFICE = load_world("office-ring")


def _room(world: World, x: float, y: float) -> str | None:
    """Name of the room at a point, None between rooms."""
    found = find_room(x, y, outlines_of(world.rooms), 0, len(world.rooms))
    return world.rooms[found].name if found >= 0 else None


def test_outlines_stand_one_after_another(two_rooms: World) -> None:
    corners, spans, bounds = outlines_of(two_rooms.rooms)
    assert spans.tolist() == [[0, 4], [4, 8]]
    for (begin, end), room in zip(spans, two_rooms.rooms, strict=True):
        assert np.array_equal(corners[begin:end], room.boundary)
    assert np.array_equal(bounds[1, :2], two_rooms.rooms[1].boundary.min(axis=0))
    assert np.array_equal(bounds[1, 2:], two_rooms.rooms[1].boundary.max(axis=0))


def test_a_world_without_rooms_has_no_outlines() -> None:
    none = outlines_of(())
    assert [array.shape for array in none] == [(0, 2), (0, 2), (0, 4)]
    assert find_room(0.0, 0.0, none, 0, 0) == -1


@given(st.floats(0, 30), st.floats(0, 30))
@settings(deadline=None, max_examples=300)
def test_rooms_are_those_of_the_world(x: float, y: float) -> None:
    corners = np.concatenate([room.boundary for room in OFFICE.rooms])
    if np.abs(corners - (x, y)).min() > 1e-6:  # On an outline either answer will do.
        assert _room(OFFICE, x, y) == OFFICE.room_at(x, y)


@pytest.mark.parametrize(("x", "name"), [(1.0, "west"), (7.0, "east"), (11.0, None)])
def test_rooms_by_name(two_rooms: World, x: float, name: str | None) -> None:
    assert _room(two_rooms, x, 2.0) == name


def test_only_the_rooms_asked_for_are_looked_at(two_rooms: World) -> None:
    outlines = outlines_of(two_rooms.rooms)
    assert find_room(1.0, 2.0, outlines, 1, 2) == -1
    assert find_room(7.0, 2.0, outlines, 1, 2) == 1
