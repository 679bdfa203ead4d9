"""The learners with a replay buffer: stable-baselines3's SAC, DQN and QRDQN set up by a plan.

Their exploration is changed for batches of hundreds of environments. All random numbers come from
generators whose state a checkpoint holds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from jaxtyping import Float64
from sb3_contrib import QRDQN
from stable_baselines3 import DQN, SAC
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from albot_agents.trained.encoders import PartEncoder
from albot_agents.training.encoders import extractor_settings
from albot_agents.training.plan import TrainingPlan

_TAU = {"sac": 0.005, "dqn": 1.0, "qrdqn": 1.0}
"""Share of the networks in their targets at each update, if the plan says none."""


def make_off_policy_learner(
    plan: TrainingPlan,
    envs: VecEnv,
    encoders: tuple[PartEncoder, ...],
    activation: type[torch.nn.Module],
    device: str,
) -> OffPolicyAlgorithm:
    """Make the untrained learner of a plan for `sac`, `dqn` or `qrdqn`.

    Args:
        plan: The plan.
        envs: The environments, `plan.n_envs` of them.
        encoders: The encoders of the policy.
        activation: Activation after each hidden layer.
        device: `cpu` or `cuda`.
    """
    own = plan.off_policy
    names = ("buffer_size", "learning_starts", "train_freq", "gradient_steps")
    settings: dict[str, Any] = {name: getattr(own, name) for name in names}
    settings |= {name: getattr(plan, name) for name in ("batch_size", "gamma", "seed")}
    settings |= {
        "tau": _TAU[plan.algorithm] if own.tau is None else own.tau,
        "learning_rate": plan.schedule("learning_rate"),
        "device": device,
    }
    network = {"activation_fn": activation, **extractor_settings(encoders)}
    make = _make_sac if plan.algorithm == "sac" else _make_value_based
    return make(plan, envs, network, settings)


def _make_sac(
    plan: TrainingPlan, envs: VecEnv, network: dict[str, Any], settings: dict[str, Any]
) -> BatchSAC:
    own, policy = plan.off_policy, plan.policy
    critic = policy.net_arch if policy.value_arch is None else policy.value_arch
    learner = BatchSAC(
        "MlpPolicy",
        envs,
        ent_coef=own.ent_coef,
        target_entropy="auto" if own.target_entropy is None else own.target_entropy,
        policy_kwargs={"net_arch": {"pi": list(policy.net_arch), "qf": list(critic)}, **network},
        **settings,
    )
    biases = learner.policy.state_dict()
    with torch.no_grad():
        if policy.initial_action is not None:
            before = np.arctanh(policy.initial_action)  # Its actions are tanh of the output.
            biases["actor.mu.bias"].copy_(torch.from_numpy(before))
        biases["actor.log_std.bias"].fill_(policy.log_std_init)
    return learner


def _make_value_based(
    plan: TrainingPlan, envs: VecEnv, network: dict[str, Any], settings: dict[str, Any]
) -> BatchDQN | BatchQRDQN:
    own, start = plan.off_policy, plan.policy.initial_action
    network["net_arch"] = list(plan.policy.net_arch)
    kind: Any = BatchDQN
    if plan.algorithm == "qrdqn":
        kind, network["n_quantiles"] = BatchQRDQN, own.n_quantiles
    learner: BatchDQN | BatchQRDQN = kind(
        "MlpPolicy",
        envs,
        exploration_fraction=own.exploration_fraction,
        exploration_initial_eps=own.exploration_initial_eps,
        exploration_final_eps=own.exploration_final_eps,
        max_grad_norm=plan.max_grad_norm,
        # With less, stable-baselines3 warns that it takes a step of all environments.
        target_update_interval=max(own.target_update_interval, plan.n_envs),
        policy_kwargs=network,
        **settings,
    )
    if start is not None:
        weights = np.exp(np.array(start) - max(start))
        learner.chances = weights / weights.sum()
    return learner


def continue_without_buffer(learner: OffPolicyAlgorithm) -> None:
    """Prepare a learner restored from a checkpoint, which has no replay buffer, for learning.

    Its buffer is filled with as many samples as at the beginning, now by the policy that it has.
    Otherwise the next update would learn from the samples of the first few steps alone.
    """
    learner.learning_starts += learner.num_timesteps
    if isinstance(learner, DQN | QRDQN):
        learner._n_calls = learner.num_timesteps // learner.n_envs


class BatchSAC(SAC):
    """SAC that draws its actions from the policy from the first step on.

    stable-baselines3 draws the first ones uniformly. One in four of these would declare home, so
    that the first episodes would be over after four steps.
    """

    def _sample_action(
        self, learning_starts: int, action_noise: Any = None, n_envs: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the actions of all environments, and these as the buffer stores them."""
        return super()._sample_action(0, action_noise, n_envs)


class _EachAtRandom(OffPolicyAlgorithm):
    """Draws for each environment separately whether it acts at random.

    stable-baselines3 draws once for all of them. With hundreds, steps in which all act at random
    would alternate with steps in which none does, and all would be sampled in that order.
    """

    exploration_schedule: Any
    chances: Float64[np.ndarray, "actions"] | None = None
    """Probability of each action among the random ones; None if all are equal."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._first_policy_step = self.learning_starts

    def _sample_action(
        self, learning_starts: int, action_noise: Any = None, n_envs: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the actions of all environments, and these as the buffer stores them."""
        assert isinstance(self._last_obs, np.ndarray)
        assert isinstance(self.action_space, spaces.Discrete)
        probability = self.exploration_schedule(1 - self.num_timesteps / self._total_timesteps)
        if self.num_timesteps < self._first_policy_step:
            probability = 1.0
        best, _ = self.policy.predict(self._last_obs, deterministic=True)
        # Drawn from the old generator, as all that stable-baselines3 draws.
        is_random = np.random.random(n_envs) < probability  # noqa: NPY002
        drawn = np.random.choice(int(self.action_space.n), n_envs, p=self.chances)  # noqa: NPY002
        actions = np.where(is_random, drawn, best)
        return actions, actions


class BatchDQN(_EachAtRandom, DQN):
    """DQN whose environments explore independently of each other."""


class BatchQRDQN(_EachAtRandom, QRDQN):
    """QR-DQN whose environments explore independently of each other."""
