"""Encoders of parts of observations in PyTorch, as features extractors of stable-baselines3."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from albot_agents.trained.encoders import (
    ABSENT,
    CONVOLUTION,
    ENDS,
    KERNEL,
    LARGEST_EXPONENT,
    PADDING,
    PLANNER,
    STRIDE,
    PartEncoder,
    path_costs,
)
from albot_agents.trained.shortest_path_kernels import add_path_derivatives, rim_cells

FEATURES = "features_extractor"
"""Name of the module in stable-baselines3's policies, and prefix of its weights' names."""


class PartsExtractor(BaseFeaturesExtractor):
    """Encodes parts of flat observations, and passes the other numbers on.

    The outputs are the numbers that no encoder takes, in order, followed by each encoder's.

    Args:
        observation_space: The space of flat observations.
        encoders: The encoders.
    """

    def __init__(self, observation_space: spaces.Box, encoders: tuple[PartEncoder, ...]) -> None:
        plain = np.ones(observation_space.shape[0], np.bool_)
        for encoder in encoders:
            plain[encoder.begin : encoder.begin + encoder.size] = False
        features = int(plain.sum()) + sum(encoder.outputs for encoder in encoders)
        super().__init__(observation_space, features)
        self._plain = torch.from_numpy(np.flatnonzero(plain))
        self._encoders = encoders
        self.parts = nn.ModuleDict({encoder.part: _module(encoder) for encoder in encoders})
        """The encoders' modules by part."""

    def forward(self, observations: Tensor) -> Tensor:
        """Return the features (observations, features) of flat observations."""
        features = [observations[:, self._plain.to(observations.device)]]
        for encoder in self._encoders:
            numbers = observations[:, encoder.begin : encoder.begin + encoder.size]
            features.append(self.parts[encoder.part](numbers))
        return torch.cat(features, dim=1)


class AttentionPool(nn.Module):
    """Pools the rows of a graph of places (see `PartEncoder`)."""

    def __init__(self, encoder: PartEncoder) -> None:
        super().__init__()
        columns = encoder.shape[1]
        self._encoder = encoder
        self.place = nn.Linear(columns, encoder.units)
        self.connection = nn.Linear(encoder.joined_columns, encoder.units)
        self.query = nn.Parameter(torch.randn(encoder.heads, encoder.units))

    def forward(self, numbers: Tensor) -> Tensor:
        """Return the pooled rows (observations, heads × units)."""
        encoder = self._encoder
        rows = numbers.reshape(-1, *encoder.shape)
        present = rows[:, :, 0] > 0
        places, connections = rows[:, : encoder.places], rows[:, encoder.places :]
        last = encoder.places - 1
        ends = ((connections[:, :, ENDS] + 1) * (max(last, 1) / 2)).round().clamp(0, last).long()
        index = ends.flatten(1).unsqueeze(2).expand(-1, -1, encoder.shape[1])
        joined = places.gather(1, index).reshape(*ends.shape, -1).flatten(2)
        own = torch.cat((connections[:, :, : ENDS.start], connections[:, :, ENDS.stop :]), dim=2)
        connected = torch.cat((own, joined), dim=2)
        embedded = torch.tanh(torch.cat((self.place(places), self.connection(connected)), dim=1))
        scores = embedded @ self.query.T / math.sqrt(encoder.units)
        shares = scores.masked_fill(~present.unsqueeze(2), float(ABSENT)).softmax(dim=1)
        pooled = shares.transpose(1, 2) @ embedded
        some = present.any(dim=1)
        return pooled.flatten(1) * some.unsqueeze(1)


class Planner(nn.Module):
    """Plans over the cells of a patch, whose costs it learns (see `PartEncoder`)."""

    def __init__(self, encoder: PartEncoder) -> None:
        super().__init__()
        self._encoder = encoder
        # At first all cells cost 1, and all ways are straight. (A linear layer would be filled by
        # stable-baselines3.)
        self.cost_weight = nn.Parameter(torch.zeros(encoder.shape[0]))
        self.cost_bias = nn.Parameter(torch.zeros(1))
        self.log_temperature = nn.Parameter(torch.zeros(1))

    def forward(self, numbers: Tensor) -> Tensor:
        """Return the shares of the rim and the length of the way (observations, outputs)."""
        patches = numbers.reshape(len(numbers), self._encoder.shape[0], -1)
        exponents = self.cost_weight @ patches + self.cost_bias
        costs = exponents.clamp(-LARGEST_EXPONENT, LARGEST_EXPONENT).exp()
        paths: Tensor = _PathCosts.apply(costs, patches, self._encoder)  # type: ignore[no-untyped-call]
        shares = (-paths * (-self.log_temperature).exp()).softmax(dim=1)
        cheapest = paths.min(dim=1, keepdim=True).values
        return torch.cat((shares, cheapest / (cheapest + self._encoder.shape[1])), dim=1)


def set_planner_costs(policy: nn.Module, costs: tuple[float, ...] | None) -> None:
    """Set what the cells cost the planners of a policy at first (see `PolicyPlan`)."""
    if costs is None:
        return
    for module in policy.modules():
        if isinstance(module, Planner):
            with torch.no_grad():  # A channel is 1 where something is, and else -1.
                module.cost_weight.copy_(0.5 * torch.tensor(costs).log())
                module.cost_bias.copy_(module.cost_weight.sum())


class _PathCosts(torch.autograd.Function):
    """The costs of a planner's paths (observations, cells of the rim)."""

    @staticmethod
    def forward(ctx: Any, costs: Tensor, patches: Tensor, encoder: PartEncoder) -> Tensor:
        """Search the paths."""
        cells = costs.detach().cpu().numpy()
        found, before = path_costs(encoder, cells, patches.detach().cpu().numpy())
        ctx.encoder, ctx.cells, ctx.before = encoder, cells.shape, before
        return torch.from_numpy(found).to(costs)

    @staticmethod
    def backward(ctx: Any, slopes: Tensor) -> tuple[Tensor, None, None]:
        """Return the gradient by the cells' costs."""
        rim = rim_cells(ctx.encoder.shape[1], ctx.encoder.radius)
        derivatives = np.zeros(ctx.cells)
        each = slopes.detach().cpu().numpy().astype(np.float64)
        add_path_derivatives(rim, ctx.before, each, derivatives)
        return torch.from_numpy(derivatives).to(slopes), None, None


def extractor_settings(encoders: tuple[PartEncoder, ...]) -> dict[str, Any]:
    """Return the arguments of a policy with these encoders; none without encoders."""
    if not encoders:
        return {}
    return {
        f"{FEATURES}_class": PartsExtractor,
        f"{FEATURES}_kwargs": {"encoders": encoders},
    }


def encoder_weights(
    state: Mapping[str, np.ndarray], encoders: tuple[PartEncoder, ...], prefix: str = ""
) -> dict[str, np.ndarray]:
    """Return the encoders' arrays under the names of `PartEncoder.shapes`.

    Args:
        state: Weights under the names of stable-baselines3's policies.
        encoders: The encoders.
        prefix: Name of the network with the features extractor, with a dot; empty for the policy.
    """
    weights: dict[str, np.ndarray] = {}
    for encoder in encoders:
        module = f"{prefix}{FEATURES}.parts.{encoder.part}"
        for name in encoder.shapes:
            inner = name.removeprefix(f"{encoder.part}.")
            if encoder.kind == CONVOLUTION:
                layer, kind = inner.removeprefix("filter").split(".")
                inner = f"{_place_of(int(layer))}.{kind}"
            weights[name] = state[f"{module}.{inner}"]
    return weights


def _module(encoder: PartEncoder) -> nn.Module:
    """Return the module that encodes a part's numbers (observations, inputs)."""
    if encoder.kind == PLANNER:
        return Planner(encoder)
    if encoder.kind != CONVOLUTION:
        return AttentionPool(encoder)
    modules: list[nn.Module] = [nn.Unflatten(1, encoder.shape)]
    channels = encoder.shape[0]
    for filters in encoder.filters:
        modules += [nn.Conv2d(channels, filters, KERNEL, STRIDE, PADDING), nn.ReLU()]
        channels = filters
    return nn.Sequential(*modules, nn.Flatten())


def _place_of(layer: int) -> int:
    """Return the place of a convolution's layer among its modules, each followed by a ReLU."""
    return 1 + 2 * layer
