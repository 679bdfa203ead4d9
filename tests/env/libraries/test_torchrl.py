"""torchrl: its environments by id, and its wrapper round a batch."""

from __future__ import annotations

from typing import Any

import gymnasium
import pytest

from tests.env import quick
from tests.env.libraries.conftest import EXPLORE

pytest.importorskip("torchrl", reason="torchrl is not installed: pip install '.[compat]'")

import torch
from torchrl.envs import GymEnv, GymWrapper, check_env_specs


@pytest.mark.parametrize("environment", quick.IDS)
def test_an_environment_by_its_id(environment: str) -> None:
    """It asks every environment to skip frames, and does so itself where that is no setting."""
    settings = {"world": quick.LOOP, **quick.SETTINGS.get(environment, {}), "mapper": "none"}
    env = GymEnv(environment, observation="dict", **settings)
    check_env_specs(env)
    seen = env.rollout(5)
    assert seen["next", "reward"].shape == (len(seen), 1)
    env.close()


def test_a_batch_in_its_wrapper() -> None:
    batch = gymnasium.make_vec("Albot/Explore-v0", num_envs=3, autoreset_mode="Disabled", **EXPLORE)
    env = GymWrapper(batch)
    env.set_seed(3)
    seen = env.rollout(14, break_when_any_done=False)
    assert seen.shape == (3, 14)
    done: Any = seen["next", "done"][..., 0]
    assert done.nonzero()[:, 1].tolist() == [5, 11] * 3  # Six steps are an episode.
    first, second = seen["observation"][:, 0], seen["observation"][:, 6]
    assert torch.isfinite(second).all() and not torch.equal(first, second)
    env.close()


def test_a_batch_that_resets_a_step_late_is_refused_by_it() -> None:
    batch = gymnasium.make_vec("Albot/Explore-v0", num_envs=3, **EXPLORE)
    with pytest.raises(RuntimeError, match="must be one of SAME_STEP or DISABLED"):
        GymWrapper(batch)
