"""The batch in stable-baselines3's form: what its learners rely on, and that they learn with it."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure

from albot_core.errors import InputError
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_env.vector.sb3 import BatchedVecEnv, make_batch, make_sb3

ENVIRONMENT = "Albot/Explore-v0"
SETTINGS = {"world": "square-loop", "mapper": "none", "max_episode_steps": 6}


def test_an_episode_s_end_tells_how_it_ended_and_what_was_seen_last() -> None:
    env = make_batch(ENVIRONMENT, 2, **SETTINGS)
    single = gymnasium.make(ENVIRONMENT, **SETTINGS)
    env.seed(8)
    first = env.reset()
    seen, _ = single.reset(seed=9)
    np.testing.assert_array_equal(first[1], seen)
    for step in range(1, 7):
        observations, rewards, dones, infos = env.step(np.full((2, 3), 0.3, np.float32))
        seen, reward, _, _, info = single.step(np.full(3, 0.3, np.float32))
        assert rewards[1] == np.float32(reward)
        assert dones.tolist() == [step == 6] * 2
        if step < 6:
            np.testing.assert_array_equal(observations[1], seen)
            assert infos == [{}, {}]
    assert infos[1]["TimeLimit.truncated"] is True
    np.testing.assert_array_equal(infos[1]["terminal_observation"], seen)
    assert infos[1]["coverage"] == info["coverage"]
    assert infos[1]["reward_terms"] == info["reward_terms"]
    after, _ = single.reset()
    np.testing.assert_array_equal(observations[1], after)


def test_who_ends_an_episode_at_its_last_step_has_not_run_out_of_time() -> None:
    """Else a learner adds the value of what would have come."""
    config = HomingConfig(outing=OutwardJourneyConfig(shortest=0.0, longest=0.0, away=0.0))
    settings = SETTINGS | {"config": config, "max_episode_steps": 1}
    env = make_batch("Albot/Homing-v0", 2, **settings)
    env.seed(1)
    env.reset()
    _, _, dones, infos = env.step(np.array(((0, 0, 1), (0, 0, -1)), np.float32))
    assert dones.all()
    assert [info["declared"] for info in infos] == [True, False]
    assert [info["TimeLimit.truncated"] for info in infos] == [False, True]


@pytest.mark.parametrize(("form", "policy"), [("flat", "MlpPolicy"), ("dict", "MultiInputPolicy")])
def test_ppo_learns_with_it_and_reports_its_returns(form: str, policy: str, tmp_path: Path) -> None:
    env = make_sb3(ENVIRONMENT, 4, observation=form, **SETTINGS)
    model = PPO(policy, env, n_steps=16, batch_size=32, n_epochs=2, seed=0, device="cpu")
    model.set_logger(configure(str(tmp_path), ["json"]))
    before = [weights.detach().clone() for weights in model.policy.parameters()]
    model.learn(128)
    assert len(model.ep_info_buffer) == 4 * (32 // 6)
    model.logger.close()
    progress = json.loads((tmp_path / "progress.json").read_text().splitlines()[-1])
    assert progress["rollout/ep_len_mean"] == 6
    mean = np.mean([episode["r"] for episode in model.ep_info_buffer])
    assert progress["rollout/ep_rew_mean"] == pytest.approx(mean)
    after = model.policy.parameters()
    assert any(not old.equal(new) for old, new in zip(before, after, strict=True))


def test_a_batch_that_resets_in_another_way_is_refused() -> None:
    batch = gymnasium.make_vec(ENVIRONMENT, num_envs=2, **SETTINGS)
    with pytest.raises(InputError, match="expected autoreset_mode SameStep"):
        BatchedVecEnv(batch)
    env = make_batch(ENVIRONMENT, 2, **SETTINGS)
    with pytest.raises(AttributeError, match="batch"):
        env.env_method("step")
    with pytest.raises(AttributeError, match="batch"):
        env.set_attr("world", 1)
    env.set_options([{"start": 0}, {"start": 1}])
    with pytest.raises(InputError, match="the same options for all"):
        env.reset()
    env.reset()  # Options are for one reset.
    assert [info["world"] for info in env.reset_infos] == ["square-loop"] * 2
    assert all(info["coverage"] >= 0.0 for info in env.reset_infos)


def test_without_stable_baselines3_it_is_said_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "albot_env.vector.sb3")
    with pytest.raises(ModuleNotFoundError, match=r"clone.*pip install -c constraints.txt"):
        importlib.import_module("albot_env.vector.sb3")
