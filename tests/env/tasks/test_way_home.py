"""Copies of distance fields for the states of episodes."""

from __future__ import annotations

import numpy as np

from albot_env.tasks.core.way_home import DistanceFieldCache, FieldCopies, empty_fields, with_field
from albot_maps import load_world


def test_all_states_of_an_episode_share_a_copy_of_its_field_and_another_has_its_own() -> None:
    world, cache = load_world("square-loop"), DistanceFieldCache()
    start = world.starts[0]
    first, second = (cache.find(world, start + off) for off in (0.0, np.array((0.3, 0, 0))))
    fields, copies = with_field(empty_fields(1), 0, first), FieldCopies(1)
    kept = copies.of(fields, 0)
    assert copies.of(fields, 0) is kept
    assert not any(array.flags.writeable for array in kept.values())
    other = copies.of(with_field(fields, 0, second), 0)
    assert other is not kept
    assert not np.array_equal(other["field.anchors"], kept["field.anchors"])
