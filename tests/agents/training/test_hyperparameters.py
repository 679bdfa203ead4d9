"""Every hyperparameter of a plan reaches the learner that it is for."""

from __future__ import annotations

import dataclasses
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv

from albot_agents.training.learner import make_learner
from albot_agents.training.plan import PolicyPlan, TrainingPlan

SETTINGS: dict[str, Any] = {
    "n_steps": 6,
    "batch_size": 4,
    "n_epochs": 3,
    "gamma": 0.91,
    "gae_lambda": 0.73,
    "vf_coef": 0.37,
    "max_grad_norm": 0.21,
    "target_kl": 0.043,
    "seed": 17,
}
"""Those that are attributes of the learner by the same names; none is a default of anyone's."""
SCHEDULES: dict[str, tuple[str, float]] = {
    "learning_rate": ("lin_0.008_0.004", 0.005),
    "clip_range": ("lin_0.4_0.2", 0.25),
}
"""Schedules, and what they come to with a quarter of the training ahead."""
ELSEWHERE = {
    "ent_coef",  # Below.
    "off_policy",  # Of other learners; test_off_policy.py.
    "task", "algorithm", "n_envs", "policy", "device", "torch_threads",
    # What is no business of the learner's.
    "n_timesteps", "env", "pretrain", "claims", "sweep", "evaluation", "curriculum",
    "checkpoint_every",
}  # fmt: skip


class _Still(gymnasium.Env[np.ndarray, np.ndarray]):
    observation_space = spaces.Box(-1, 1, (3,), np.float32)
    action_space = spaces.Box(-1, 1, (2,), np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return np.zeros(3, np.float32), {}

    def step(self, action: np.ndarray) -> Any:
        return np.zeros(3, np.float32), 0.0, False, False, {}


def learner_of(**changes: Any) -> Any:
    plan = TrainingPlan(
        n_envs=2,
        ent_coef="lin_0.07_0.01",
        **{name: text for name, (text, _) in SCHEDULES.items()} | SETTINGS | changes,
    )
    return make_learner(plan, DummyVecEnv([_Still, _Still]))


@pytest.mark.parametrize("algorithm", ["ppo", "recurrent_ppo"])
def test_the_learner_has_what_the_plan_says(algorithm: str) -> None:
    assert {field.name for field in dataclasses.fields(TrainingPlan)} == (
        SETTINGS.keys() | SCHEDULES.keys() | ELSEWHERE
    )
    learner = learner_of(algorithm=algorithm)
    assert {name: getattr(learner, name) for name in SETTINGS} == SETTINGS
    # What the learner hands on: advantages are worked out in the buffer, steps made by Adam.
    buffer = learner.rollout_buffer
    assert (buffer.gamma, buffer.gae_lambda, buffer.buffer_size) == (0.91, 0.73, 6)
    (group,) = learner.policy.optimizer.param_groups
    assert group["lr"] == 0.008
    assert learner.ent_coef == 0.07
    assert learner.lr_schedule(0.25) == pytest.approx(SCHEDULES["learning_rate"][1])
    assert learner.clip_range(0.25) == pytest.approx(SCHEDULES["clip_range"][1])


def test_the_networks_are_those_of_the_plan() -> None:
    policy = PolicyPlan(
        net_arch=(5, 7), value_arch=(11,), activation="elu", log_std_init=-1.3,
        initial_action=(0.25, -0.5),
    )  # fmt: skip
    learner = learner_of(policy=policy)

    def sizes(network: torch.nn.Module) -> list[int]:
        layers = (layer for layer in network if isinstance(layer, torch.nn.Linear))  # type: ignore[attr-defined]
        return [layer.out_features for layer in layers]

    extractor = learner.policy.mlp_extractor
    assert sizes(extractor.policy_net) == [5, 7]
    assert sizes(extractor.value_net) == [11]
    assert {type(layer) for layer in extractor.policy_net} == {torch.nn.Linear, torch.nn.ELU}
    assert learner.policy.log_std.tolist() == pytest.approx([-1.3, -1.3])
    assert learner.policy.action_net.bias.tolist() == [0.25, -0.5]


def test_the_memory_is_that_of_the_plan() -> None:
    policy = PolicyPlan(net_arch=(4,), lstm_size=6, lstm_layers=2, initial_action=None)
    lstm = learner_of(algorithm="recurrent_ppo", policy=policy).policy.lstm_actor
    assert (lstm.hidden_size, lstm.num_layers) == (6, 2)


def test_threads_are_those_of_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    monkeypatch.setattr(torch, "set_num_threads", given.append)
    learner_of(torch_threads=3)
    learner_of(torch_threads=0)  # Torch's own choice.
    assert given == [3]
