"""The learner: stable-baselines3's PPO as a plan wants it."""

from __future__ import annotations

from typing import Any

import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from albot_agents.training.candidates import CandidatePolicy
from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_core.errors import InputError

_ACTIVATIONS = {"elu": torch.nn.ELU, "relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}
GPU_UNITS = 1024
"""Units of a hidden layer from which on `auto` takes the GPU. At every step of the environments
data go there and back, so that small networks are slower there (stable-baselines3 warns of that
itself, with its issue 1245)."""


def make_learner(plan: TrainingPlan, envs: VecEnv) -> OnPolicyAlgorithm:
    """The learner of a plan, which knows nothing yet.

    Args:
        plan: The plan.
        envs: The environments, `plan.n_envs` of them.

    Raises:
        InputError: The initial action does not fit the actions, or there is no GPU where one
            is asked for.
    """
    if plan.torch_threads:
        torch.set_num_threads(plan.torch_threads)
    numbers: dict[str, Any] = {
        name: getattr(plan, name)
        for name in (
            "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "vf_coef",
            "max_grad_norm", "target_kl", "seed",
        )
    }  # fmt: skip
    numbers |= {name: plan.schedule(name) for name in ("learning_rate", "clip_range")}
    kind: Any = RecurrentPPO if plan.recurrent else PPO
    learner: OnPolicyAlgorithm = kind(
        _policy_kind(plan),
        envs,
        ent_coef=plan.schedule("ent_coef").first,
        policy_kwargs=_policy_settings(plan),
        device=choose_device(plan),
        **numbers,
    )
    _set_initial_action(learner, plan.policy)
    return learner


def choose_device(plan: TrainingPlan) -> str:
    """`cpu` or `cuda`.

    Raises:
        InputError: The plan insists on a GPU, and there is none.
    """
    there = torch.cuda.is_available()
    if plan.device == "cuda" and not there:
        raise InputError("TrainingPlan.device", "auto or cpu, since there is no GPU", "cuda")
    if plan.device != "auto":
        return plan.device
    policy = plan.policy
    widest = max((*policy.net_arch, *(policy.value_arch or ()), policy.lstm_size * plan.recurrent))
    return "cuda" if there and widest >= GPU_UNITS else "cpu"


def _policy_kind(plan: TrainingPlan) -> str | type[CandidatePolicy]:
    if plan.recurrent:
        return "MlpLstmPolicy"
    return CandidatePolicy if plan.policy.kind == "candidates" else "MlpPolicy"


def _policy_settings(plan: TrainingPlan) -> dict[str, Any]:
    policy = plan.policy
    values = policy.net_arch if policy.value_arch is None else policy.value_arch
    settings: dict[str, Any] = {
        "net_arch": {"pi": list(policy.net_arch), "vf": list(values)},
        "activation_fn": _ACTIVATIONS[policy.activation],
        "log_std_init": policy.log_std_init,
    }
    if plan.recurrent:
        settings |= {"lstm_hidden_size": policy.lstm_size, "n_lstm_layers": policy.lstm_layers}
    return settings


def _set_initial_action(learner: OnPolicyAlgorithm, policy: PolicyPlan) -> None:
    """Let the policy begin with what the plan says."""
    if policy.initial_action is None:
        return
    bias = learner.policy.action_net.bias
    assert isinstance(bias, torch.nn.Parameter)
    if len(policy.initial_action) != len(bias):
        found = str(len(policy.initial_action))
        raise InputError("PolicyPlan.initial_action", f"{len(bias)} numbers", found)
    with torch.no_grad():
        bias.copy_(torch.tensor(policy.initial_action))
