"""Copies of environments."""

from __future__ import annotations

import copy

import gymnasium
import numpy as np

from tests.env.quick import LOOP


def test_a_copy_goes_on_as_the_original_and_keeps_what_was_added() -> None:
    env = gymnasium.make("Albot/Explore-v0", world=LOOP, mapper="none").unwrapped
    env.reset(seed=1)
    env.note = ["mine"]  # type: ignore[attr-defined]
    twin = copy.deepcopy(env)
    assert twin.note == ["mine"]  # type: ignore[attr-defined]
    assert twin.note is not env.note  # type: ignore[attr-defined]
    action = np.array((0.5, 0.2, -1.0), np.float32)
    for _ in range(3):
        np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])
