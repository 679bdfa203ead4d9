"""What a training consists of: all that stands in its YAML file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from albot_agents.evaluation.plan import parse_seeds
from albot_core.errors import InputError, did_you_mean
from albot_core.ranges import FINITE, POSITIVE, SHARE, Range, check_fields

ALGORITHMS = ("ppo", "recurrent_ppo")
"""Proximal policy optimisation (Schulman et al., arXiv:1707.06347), without and with an LSTM."""
POLICIES = ("mlp", "candidates")
"""An observation looked at as a whole; or candidates, each looked at by the same network."""
ACTIVATIONS = ("elu", "relu", "tanh")
DEVICES = ("auto", "cpu", "cuda")

_COUNT = Range("a whole number from 1", 1.0, whole=True)
_FROM_ZERO = Range("a whole number from 0", 0.0, whole=True)
_FROM_TWO = Range("a whole number from 2, to find a deviation of", 2.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class PolicyPlan:
    """The networks. Policy and value have one each, and share nothing."""

    kind: str = "mlp"
    """`mlp`, or `candidates`: for tasks that ask which of several it is, if any. The networks then
    look at each candidate alone, and at what is largest in any of them."""
    net_arch: tuple[int, ...] = (64, 64)
    """Units in the hidden layers."""
    value_arch: tuple[int, ...] | None = None
    """Those of the value's network, where they are others."""
    activation: str = "tanh"
    """`tanh`, `relu` or `elu`."""
    log_std_init: float = 0.0
    """Logarithm of the actions' standard deviation at the beginning."""
    initial_action: tuple[float, ...] | None = None
    """What the policy does in the mean at the beginning (of a discrete set, the logarithms of
    its preferences; of candidates, of "none" and of each of them); None for 0. A policy that
    declares by chance at every third step never sees what driving is good for."""
    sampled: bool = False
    """Whether the agent draws its numbers by chance, as in training, rather than do what the
    policy does in the mean: that may stand still for ever where it turns neither way. The
    evaluations on the way go by the mean all the same. Not for discrete actions."""
    lstm_size: int = 128
    """Units of each LSTM layer, of `recurrent_ppo` only."""
    lstm_layers: int = 1
    """LSTM layers before the hidden ones, of `recurrent_ppo` only."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "lstm_size", "lstm_layers")
        check_fields(self, FINITE, "log_std_init")
        if any(number not in FINITE for number in self.initial_action or ()):
            found = str(list(self.initial_action or ()))
            raise InputError("PolicyPlan.initial_action", "finite numbers", found)
        for name in ("net_arch", "value_arch"):
            if any(units not in _COUNT for units in getattr(self, name) or ()):
                raise InputError(f"PolicyPlan.{name}", "sizes from 1", str(getattr(self, name)))
        _check_name("PolicyPlan.kind", self.kind, POLICIES)
        _check_name("PolicyPlan.activation", self.activation, ACTIVATIONS)


@dataclass(frozen=True, kw_only=True)
class EvaluationPlan:
    """How the policy is measured on the way, always in the same episodes."""

    worlds: tuple[str, ...] = ("random:office",)
    """World specs as for `albot evaluate`: of `random:KIND` each seed is a world of its own."""
    seeds: str = "900..963"
    """`A..B`, both included: each world with each seed is an episode."""
    every: int = 1_000_000
    """Samples between two evaluations."""
    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment that are others than in the training."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "every")
        if not self.worlds:
            raise InputError("EvaluationPlan.worlds", "one world or more", "none")
        try:
            parse_seeds(self.seeds)
        except InputError as error:
            raise InputError("EvaluationPlan.seeds", error.expected, error.found) from None


@dataclass(frozen=True, kw_only=True)
class StagePlan:
    """A stage of a curriculum. It ends with what comes first; the last one never does."""

    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment that are others than those of the whole training."""
    for_steps: int | None = None
    """Samples after which the next stage begins."""
    until_success: float | None = None
    """Share of the last 500 episodes that succeed when the next stage begins."""

    def __post_init__(self) -> None:
        if self.for_steps is not None:
            check_fields(self, _COUNT, "for_steps")
        if self.until_success is not None:
            check_fields(self, SHARE, "until_success")


@dataclass(frozen=True, kw_only=True)
class TrainingPlan:
    """A training. The names are those of rl-zoo3 and stable-baselines3 where these have one."""

    task: str = ""
    """Id of the environment."""
    algorithm: str = "ppo"
    """`ppo` or `recurrent_ppo`."""
    n_timesteps: int = 10_000_000
    """Samples in all."""
    n_envs: int = 1024
    """Environments that are stepped together."""
    policy: PolicyPlan = field(default_factory=PolicyPlan)
    """The networks."""
    n_steps: int = 32
    """Steps of each environment between two updates."""
    batch_size: int = 8192
    """Samples in a gradient step."""
    n_epochs: int = 4
    """How often each sample is used."""
    learning_rate: float | str = "lin_0.0003"
    """Adam's; a number or a schedule."""
    gamma: float = 0.995
    """Discount factor of a step."""
    gae_lambda: float = 0.95
    """λ of generalised advantage estimation (Schulman et al., arXiv:1506.02438)."""
    clip_range: float | str = 0.2
    """ε of PPO's clipping; a number or a schedule."""
    ent_coef: float | str = 0.0
    """What a unit of entropy is worth; a number or a schedule."""
    vf_coef: float = 0.5
    """What the value's error weighs in the loss."""
    max_grad_norm: float = 0.5
    """Longer gradients are shortened to this."""
    target_kl: float | None = None
    """Divergence from the policy that drove beyond which an update ends."""
    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment, `config` among them. A list of worlds is dealt out to the
    environments in turn."""
    evaluation: EvaluationPlan | None = field(default_factory=EvaluationPlan)
    """How the policy is measured on the way; none where it is not."""
    curriculum: tuple[StagePlan, ...] = ()
    """Stages one after the other; none for one without end."""
    checkpoint_every: int = 500_000
    """Samples between two checkpoints."""
    seed: int = 0
    """Decides all chance. Worlds and episodes are drawn by it, and the first weights."""
    device: str = "auto"
    """`cpu`, `cuda`, or `auto`: the GPU where there is one and the networks are large enough to
    gain by it."""
    torch_threads: int = 1
    """Threads of the learner; 0 for as many as there are processors. Two that share their
    processors with another process wait for each other, ten times longer than one works."""

    def __post_init__(self) -> None:
        counts = "n_timesteps", "n_envs", "n_steps", "n_epochs", "checkpoint_every"
        check_fields(self, _COUNT, *counts)
        check_fields(self, _FROM_TWO, "batch_size")
        check_fields(self, FINITE, "vf_coef")
        if self.target_kl is not None:
            check_fields(self, POSITIVE, "target_kl")
        check_fields(self, _FROM_ZERO, "seed", "torch_threads")
        check_fields(self, SHARE, "gamma", "gae_lambda")
        check_fields(self, POSITIVE, "max_grad_norm")
        _check_name("TrainingPlan.algorithm", self.algorithm, ALGORITHMS)
        _check_name("TrainingPlan.device", self.device, DEVICES)
        if self.recurrent and self.policy.kind != "mlp":
            raise InputError("TrainingPlan.policy", "kind mlp for an LSTM", self.policy.kind)
        for name in ("learning_rate", "clip_range", "ent_coef"):
            self.schedule(name)
        samples = self.n_envs * self.n_steps
        if samples % self.batch_size:
            expected = f"a part of n_envs × n_steps, {samples}"
            raise InputError("TrainingPlan.batch_size", expected, str(self.batch_size))
        if any(stage.for_steps is stage.until_success is None for stage in self.curriculum[:-1]):
            expected = "for_steps or until_success in all stages but the last"
            raise InputError("TrainingPlan.curriculum", expected, "neither in one")

    def schedule(self, name: str) -> Schedule:
        """The schedule of a number that has one.

        Raises:
            InputError: The text is no schedule.
        """
        return parse_schedule(getattr(self, name), f"TrainingPlan.{name}")

    @property
    def recurrent(self) -> bool:
        """Whether the policy remembers."""
        return self.algorithm == "recurrent_ppo"

    @property
    def stages(self) -> tuple[StagePlan, ...]:
        """The stages, of which there is always one."""
        return self.curriculum or (StagePlan(),)


def _check_name(place: str, name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise InputError(place, f"one of {', '.join(names)}", f"{name}{did_you_mean(name, names)}")


_LINEAR = re.compile(r"lin_([^_]+)(?:_([^_]+))?")


@dataclass(frozen=True)
class Schedule:
    """A number that goes evenly from one value to another."""

    first: float
    """Its value at the beginning…"""
    last: float
    """…and at the end."""

    def __call__(self, remaining: float | int) -> float:
        """The value when this share of the training is still to come."""
        return self.last + (self.first - self.last) * remaining


def parse_schedule(value: float | str, name: str) -> Schedule:
    """The schedule that a number stands for, or `lin_A` (from A to 0), or `lin_A_B`.

    Args:
        value: What is written.
        name: What is scheduled, for the error.

    Raises:
        InputError: It is something else, or a value of it is negative or not finite.
    """
    expected = "a number from 0, lin_A or lin_A_B"
    try:
        if isinstance(value, str):
            found = _LINEAR.fullmatch(value)
            if found is None:
                raise ValueError
            schedule = Schedule(float(found[1]), float(found[2] or 0))
        else:
            schedule = Schedule(value, value)
    except ValueError:
        raise InputError(name, expected, str(value)) from None
    if not (0 <= schedule.first < math.inf and 0 <= schedule.last < math.inf):
        raise InputError(name, expected, str(value))
    return schedule
