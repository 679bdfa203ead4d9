"""Apartments: where their doors are."""

from __future__ import annotations

import numpy as np
import pytest

from albot_maps import load_world

JAMB = 0.15
"""A door's least distance from a corner of a room (m)."""


@pytest.mark.parametrize("seed", range(6))
def test_a_door_lies_wholly_in_the_wall_that_its_rooms_share(seed: int) -> None:
    world = load_world(f"random:apartment:{seed}?rooms=7&door_width=0.9")
    outlines = {room.name: room.boundary for room in world.rooms}
    for door in world.exits:
        ends = door.segment.reshape(2, 2)
        along = int(np.argmax(np.ptp(ends, axis=0)))
        assert np.ptp(ends, axis=0)[along] == pytest.approx(0.9)
        for name in door.rooms:
            low, high = outlines[name].min(axis=0), outlines[name].max(axis=0)
            assert ends[:, along].min() >= low[along] + JAMB - 1e-9
            assert ends[:, along].max() <= high[along] - JAMB + 1e-9
        # One room is on each side, as far away as the wall is thick.
        sides = np.array([outlines[name].mean(axis=0) for name in door.rooms]) - ends[0]
        assert np.prod(sides[:, 1 - along]) < 0
