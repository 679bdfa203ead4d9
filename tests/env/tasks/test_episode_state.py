"""When episodes of two environments can be exchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_env.tasks.core.episode_state import is_same_world
from albot_maps import load_world


@pytest.mark.parametrize("part", ["walls", "glass", "starts"])
def test_a_world_with_one_part_that_differs_is_another(part: str) -> None:
    world = load_world("square-loop")
    other = replace(world, **{part: np.array(getattr(world, part))})
    assert is_same_world(world, other)
    array = np.array(getattr(world, part))
    changed = ~array if array.dtype == np.bool_ else array + 0.01
    assert not is_same_world(world, replace(world, **{part: changed}))
