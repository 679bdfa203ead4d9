"""stable-baselines3 and sb3-contrib: each learner takes in a few steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from sb3_contrib import QRDQN, TQC, TRPO, MaskablePPO, RecurrentPPO
from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
from stable_baselines3 import A2C, DDPG, DQN, PPO, SAC, TD3
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize, VecVideoRecorder

from albot_env.vector.sb3 import make_batch, make_sb3
from tests.env.libraries.conftest import EXPLORE, RECOGNISE, Clip

ENVIRONMENT = "Albot/Explore-v0"
ON_POLICY = [
    (PPO, {"n_steps": 8, "batch_size": 8, "n_epochs": 1}),
    (A2C, {"n_steps": 4}),
    (TRPO, {"n_steps": 8, "batch_size": 8}),
]
OFF_POLICY = {"learning_starts": 8, "buffer_size": 64, "batch_size": 8, "train_freq": 4}
SMALL = {"net_arch": [8]}


def _learns(model: Any, steps: int = 24) -> None:
    """Check that a learner's weights change, and that it then answers with an action."""
    before = [weights.detach().clone() for weights in model.policy.parameters()]
    model.learn(steps)
    after = model.policy.parameters()
    assert any(not old.equal(new) for old, new in zip(before, after, strict=True))
    action, _ = model.predict(model.get_env().reset())
    assert len(action) == model.get_env().num_envs


@pytest.mark.parametrize(("learner", "options"), ON_POLICY, ids=lambda made: str(made)[:40])
@pytest.mark.parametrize("form", ["continuous", "discrete"])
def test_learners_on_policy(learner: Any, options: dict[str, Any], form: str) -> None:
    env = make_sb3(ENVIRONMENT, 2, action=form, **EXPLORE)
    _learns(learner("MlpPolicy", env, policy_kwargs=dict(SMALL), device="cpu", **options))


@pytest.mark.parametrize("learner", [SAC, TD3, DDPG, TQC])
def test_learners_off_policy_of_continuous_actions(learner: Any) -> None:
    env = make_sb3(ENVIRONMENT, 2, **EXPLORE)
    _learns(learner("MlpPolicy", env, policy_kwargs=dict(SMALL), device="cpu", **OFF_POLICY))


@pytest.mark.parametrize("learner", [DQN, QRDQN])
def test_learners_off_policy_of_discrete_actions(learner: Any) -> None:
    env = make_sb3(ENVIRONMENT, 2, action="discrete", **EXPLORE)
    _learns(learner("MlpPolicy", env, policy_kwargs=dict(SMALL), device="cpu", **OFF_POLICY))


def test_a_learner_with_memory() -> None:
    env = make_sb3(ENVIRONMENT, 2, **EXPLORE)
    options = {"n_steps": 8, "batch_size": 8, "n_epochs": 1}
    kept = SMALL | {"lstm_hidden_size": 8}
    _learns(RecurrentPPO("MlpLstmPolicy", env, policy_kwargs=kept, device="cpu", **options))


@pytest.mark.parametrize("batched", [True, False])
def test_a_learner_with_masks_recognises_places(batched: bool) -> None:
    environment = "Albot/PlaceRecognition-v0"
    if batched:
        env: Any = make_sb3(environment, 2, **RECOGNISE)
    else:
        env = DummyVecEnv([lambda: gymnasium.make(environment, **RECOGNISE) for _ in range(2)])
    assert is_masking_supported(env)
    options = {"n_steps": 8, "batch_size": 8, "n_epochs": 1}
    model = MaskablePPO("MlpPolicy", env, policy_kwargs=dict(SMALL), device="cpu", **options)
    model.learn(16)
    observations = env.reset()
    for _ in range(8):
        masks = get_action_masks(env)
        # 0 for a new place; then what the observation itself says of the earlier arrivals.
        np.testing.assert_array_equal(masks[:, 0], True)
        np.testing.assert_array_equal(masks[:, 1:], observations[:, -3:] > 0)
        answers, _ = model.predict(observations, action_masks=masks)
        assert masks[np.arange(2), answers].all()
        observations, *_ = env.step(answers)


def test_tasks_without_masks_say_so() -> None:
    assert not is_masking_supported(make_sb3(ENVIRONMENT, 2, action="discrete", **EXPLORE))
    with pytest.raises(AttributeError, match="batch have no attribute 'action_masks'"):
        make_batch(ENVIRONMENT, 2, **EXPLORE).env_method("action_masks")


def test_normalised_and_checked_as_its_own() -> None:
    check_env(gymnasium.make(ENVIRONMENT, **EXPLORE).unwrapped, skip_render_check=True)
    env = VecNormalize(make_sb3(ENVIRONMENT, 2, **EXPLORE))
    assert np.isfinite(env.reset()).all()


def test_the_environments_of_a_batch_have_attributes_and_methods() -> None:
    env = make_batch(ENVIRONMENT, 3, **EXPLORE)
    env.seed(4)
    env.reset()
    assert env.get_attr("render_mode", [0, 2]) == [None, None]
    states = env.env_method("get_state")
    assert [state.steps for state in states] == [0, 0, 0]
    env.step(np.zeros((3, 3), np.float32))
    ((observation, _),) = env.env_method("set_state", states[2], indices=[1])
    np.testing.assert_array_equal(observation, states[2].robot.arrays["observation"])
    assert [state.steps for state in env.env_method("get_state")] == [1, 0, 1]
    env.set_attr("np_random", np.random.default_rng(3), [1])
    assert env.get_attr("np_random")[1].integers(1000) == np.random.default_rng(3).integers(1000)


def test_a_video_of_a_batch(clips: list[Clip], tmp_path: Path) -> None:
    env = make_sb3(ENVIRONMENT, 2, render_mode="rgb_array", **EXPLORE)
    film = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=3)
    film.reset()
    for _ in range(4):
        film.step(np.full((2, 3), 0.5, np.float32))
    (clip,) = clips
    assert (len(clip.frames), clip.fps) == (4, 10)
    assert not np.array_equal(clip.frames[0], clip.frames[-1])
