"""The learner: stable-baselines3's algorithm set up by a plan, and a policy for candidates."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.common.vec_env import VecEnv

from albot_agents.trained.encoders import ABSENT, PartEncoder
from albot_agents.trained.network import NOTHING
from albot_agents.training.encoders import extractor_settings, set_planner_costs
from albot_agents.training.off_policy import make_off_policy_learner
from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_agents.training.plan_check import check_device

_ACTIVATIONS = {"elu": torch.nn.ELU, "relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}
GPU_UNITS = 1024
"""Units of a hidden layer from which `auto` selects the GPU. Data are copied to the GPU and back at
every step of the environments, so small networks are slower there (stable-baselines3 warns of this
too, in its issue 1245)."""


def make_learner(
    plan: TrainingPlan, envs: VecEnv, encoders: tuple[PartEncoder, ...] = ()
) -> BaseAlgorithm:
    """Make the untrained learner of a plan.

    Args:
        plan: The plan.
        envs: The environments, `plan.n_envs` of them.
        encoders: The encoders of the policy, as `policy_encoders` returns them.

    Raises:
        InputError: The plan requests a GPU, and there is none.
    """
    if plan.torch_threads:
        torch.set_num_threads(plan.torch_threads)
    if plan.learns_off_policy:
        activation = _ACTIVATIONS[plan.policy.activation]
        made = make_off_policy_learner(plan, envs, encoders, activation, choose_device(plan))
        set_planner_costs(made.policy, plan.policy.planner_costs)
        return made
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
        policy_kwargs=_policy_settings(plan) | extractor_settings(encoders),
        device=choose_device(plan),
        **numbers,
    )
    _set_initial_action(learner, plan.policy)
    set_planner_costs(learner.policy, plan.policy.planner_costs)
    return learner


def choose_device(plan: TrainingPlan) -> str:
    """Return the plan's device, `cpu` or `cuda`.

    Raises:
        InputError: The plan requests a GPU, and there is none.
    """
    check_device(plan)
    if plan.device != "auto":
        return plan.device
    policy = plan.policy
    widest = max((*policy.net_arch, *(policy.value_arch or ()), policy.lstm_size * plan.recurrent))
    return "cuda" if torch.cuda.is_available() and widest >= GPU_UNITS else "cpu"


def _policy_kind(plan: TrainingPlan) -> str | type[DeepSetsPolicy]:
    if plan.recurrent:
        return "MlpLstmPolicy"
    return DeepSetsPolicy if plan.policy.kind == "candidates" else "MlpPolicy"


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
    """Set the policy's output bias to the plan's initial action, which has been checked."""
    if policy.initial_action is None:
        return
    bias = learner.policy.action_net.bias
    assert isinstance(bias, torch.nn.Parameter)
    with torch.no_grad():
        bias.copy_(torch.tensor(policy.initial_action))


class DeepSetsPolicy(ActorCriticPolicy):
    """Chooses one of several candidates, or none of them, independently of their order.

    After Zaheer et al., Deep sets, NeurIPS 2017, with the maximum instead of the sum. The same
    layers score each candidate separately. The score of "none" is computed from each unit's maximum
    over the candidates; so is the value, by a network of its own. `NetworkConfig` describes
    observations and outputs.
    """

    def _build_mlp_extractor(self) -> None:
        assert isinstance(self.action_space, spaces.Discrete)
        self.mlp_extractor = DeepSetsExtractor(
            int(self.action_space.n) - 1,
            self.features_dim,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )

    def _build(self, lr_schedule: Any) -> None:
        assert isinstance(self.action_space, spaces.Discrete)
        self.action_dist = _Answers(int(self.action_space.n))
        super()._build(lr_schedule)


class DeepSetsExtractor(MlpExtractor):
    """Networks of policy and value that are applied to each candidate separately.

    Args:
        candidates: Largest number of candidates.
        length: Length of an observation.
        settings: Further arguments of `MlpExtractor`.
    """

    def __init__(self, candidates: int, length: int, **settings: Any) -> None:
        self._candidates = candidates
        self._width = length // candidates - 1
        super().__init__(self._width, **settings)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the units pooled over all candidates, followed by the units of each candidate.

        The shape is (observations, 1 + candidates, units + 1). The last number says whether the
        candidate is present.
        """
        rows, there = self._split(features)
        units = self.policy_net(rows)
        each = torch.cat((units, there.to(units.dtype)), dim=2)
        together = torch.nn.functional.pad(_pooled(units, there), (0, 1), value=1.0)
        return torch.cat((together[:, None], each), dim=1)

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Return the units pooled over all candidates, of shape (observations, units)."""
        rows, there = self._split(features)
        return _pooled(self.value_net(rows), there)

    def _split(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the candidates' rows, and a mask of those present (…, candidates, 1)."""
        end = self._candidates * self._width
        rows = features[:, :end].reshape(-1, self._candidates, self._width)
        return rows, features[:, end:, None] > 0


class _Answers(CategoricalDistribution):
    """A distribution over "none" and the candidates."""

    def proba_distribution_net(self, latent_dim: int) -> torch.nn.Module:
        """Return the layer that computes the logits."""
        return _AnswerLayer(latent_dim, 2)


class _AnswerLayer(torch.nn.Linear):
    """Scores "none" from the pooled units, and "this one" from the units of each candidate."""

    def forward(self, latent: torch.Tensor) -> torch.Tensor:
        """Return the logits (observations, 1 + candidates) for the output of `forward_actor`."""
        scores, there = super().forward(latent[:, :, :-1]), latent[:, 1:, -1] > 0
        this = scores[:, 1:, 1].masked_fill(~there, float(ABSENT))
        return torch.cat((scores[:, :1, 0], this), dim=1)


def _pooled(units: torch.Tensor, there: torch.Tensor) -> torch.Tensor:
    """Return each unit's maximum over the candidates that are present."""
    return units.masked_fill(~there, float(NOTHING)).amax(dim=1).clamp(min=float(NOTHING))
