"""The policy that weighs candidates: one network for all of them, as stable-baselines3 takes it."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor

from albot_agents.trained.network import ABSENT, NOTHING


class CandidatePolicy(ActorCriticPolicy):
    """Says which candidate it is, or that it is none: the same whatever their order.

    Each candidate is looked at alone, by the same layers, and "none" by the largest that
    each unit gives for any (as in Zaheer et al., Deep sets, NeurIPS 2017, with the maximum for the
    sum). The value goes by what is largest in the units of a network of its own. Observations and
    answers are as `NetworkConfig` says.
    """

    def _build_mlp_extractor(self) -> None:
        assert isinstance(self.action_space, spaces.Discrete)
        self.mlp_extractor = CandidateExtractor(
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


class CandidateExtractor(MlpExtractor):
    """Networks of policy and value that look at each candidate alone.

    Args:
        candidates: How many there can be.
        length: Numbers in an observation.
        settings: As for `MlpExtractor`.
    """

    def __init__(self, candidates: int, length: int, **settings: Any) -> None:
        self._candidates = candidates
        self._width = length // candidates - 1
        super().__init__(self._width, **settings)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """What is made of all candidates together, and of each.

        Of shape (observations, 1 + candidates, units + 1); the last number says whether it is
        there.
        """
        rows, there = self._split(features)
        seen = self.policy_net(rows)
        each = torch.cat((seen, there.to(seen.dtype)), dim=2)
        together = torch.nn.functional.pad(_pooled(seen, there), (0, 1), value=1.0)
        return torch.cat((together[:, None], each), dim=1)

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """What is made of all candidates together, of shape (observations, units)."""
        rows, there = self._split(features)
        return _pooled(self.value_net(rows), there)

    def _split(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The candidates' rows, and which of them are there (…, candidates, 1)."""
        end = self._candidates * self._width
        rows = features[:, :end].reshape(-1, self._candidates, self._width)
        return rows, features[:, end:, None] > 0


class _Answers(CategoricalDistribution):
    """A distribution over "none" and the candidates."""

    def proba_distribution_net(self, latent_dim: int) -> torch.nn.Module:
        """The layer that gives its logits."""
        return _AnswerNet(latent_dim, 2)


class _AnswerNet(torch.nn.Linear):
    """Two numbers of each: how much says "none", which counts of all together, and "this one"."""

    def forward(self, latent: torch.Tensor) -> torch.Tensor:
        """The logits (observations, 1 + candidates) of what `forward_actor` gives."""
        scores, there = super().forward(latent[:, :, :-1]), latent[:, 1:, -1] > 0
        this = scores[:, 1:, 1].masked_fill(~there, float(ABSENT))
        return torch.cat((scores[:, :1, 0], this), dim=1)


def _pooled(seen: torch.Tensor, there: torch.Tensor) -> torch.Tensor:
    """The largest that each unit gives for any candidate that is there."""
    return seen.masked_fill(~there, float(NOTHING)).amax(dim=1).clamp(min=float(NOTHING))
