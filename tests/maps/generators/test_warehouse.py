"""Warehouses: how aisles and cross aisles lie."""

from __future__ import annotations

import pytest

from albot_maps import load_world


@pytest.mark.parametrize("crosses", [0, 1, 3])
def test_cross_aisles_lie_between_front_and_back_and_aisles_join_two_of_them(crosses: int) -> None:
    world = load_world(f"random:warehouse:1?cross_aisles={crosses}&aisles=3&bays=2")
    across = ["front", *(f"cross {number}" for number in range(1, crosses + 1)), "back"]
    middles = {room.name: room.boundary.mean(axis=0) for room in world.rooms}
    found = [name for name in middles if not name.startswith("aisle")]
    assert sorted(found, key=lambda name: middles[name][1]) == across
    assert world.room_at(*world.starts[0, :2]) == "front"
    joined = {}
    for opening in world.exits:
        (aisle,) = set(opening.rooms) - set(across)
        (other,) = set(opening.rooms) & set(across)
        joined.setdefault(aisle, set()).add(other)
    assert len(joined) == 3 * (crosses + 1) == len(middles) - len(across)
    for aisle, ends in joined.items():
        low, high = sorted(ends, key=across.index)
        assert across.index(high) == across.index(low) + 1
        assert middles[low][1] < middles[aisle][1] < middles[high][1]
