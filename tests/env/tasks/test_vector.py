"""Steps of many environments at once."""

from __future__ import annotations

import gymnasium

from tests.env.quick import LOOP, still


def test_without_a_limit_nothing_is_truncated() -> None:
    envs = gymnasium.make_vec("Albot/ExploreAndHome-v1", num_envs=2, world=LOOP, mapper="none")
    envs.reset(seed=1)
    _, _, _, truncated, _ = envs.step(still("Albot/ExploreAndHome-v1", 2))
    envs.close()
    assert not truncated.any()
