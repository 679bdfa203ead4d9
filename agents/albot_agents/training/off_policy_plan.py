"""The part of a training plan for algorithms that learn from a replay buffer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from albot_core.errors import InputError
from albot_core.ranges import FINITE, FROM_ONE, NOT_NEGATIVE, SHARE, Range, check_fields

VALUE_BASED = ("dqn", "qrdqn")
"""Deep Q-learning (Mnih et al., Nature 518, 2015), and the same with the distribution of returns
(Dabney et al., Distributional reinforcement learning with quantile regression, AAAI 2018)."""
OFF_POLICY = ("sac", *VALUE_BASED)
"""Soft actor-critic (Haarnoja et al., arXiv:1812.05905), and those above."""

_ABOVE_ZERO = Range("a number above 0, at most 1", 0.0, 1.0, beyond=True)
_QUANTILES = Range("a whole number from 1 to 1024", 1.0, 1024.0, whole=True)
_AUTO = "auto"


@dataclass(frozen=True, kw_only=True)
class OffPolicyPlan:
    """Replay buffer, updates and exploration of `sac`, `dqn` and `qrdqn`.

    Names and meanings are those of stable-baselines3. A sample is one step of one environment.
    """

    buffer_size: int = 500_000
    """Samples in the replay buffer; the oldest are replaced. Each takes 8 bytes per number of an
    observation and 4 per number of an action, and 12 more. Half of the machine's memory at most."""
    learning_starts: int = 20_000
    """Samples before the first update, less than `n_timesteps`: with random actions for `dqn` and
    `qrdqn`, with those of the initial policy for `sac`. After `--resume` so many new samples."""
    train_freq: int = 1
    """Steps of all environments together between two updates."""
    gradient_steps: int = 4
    """Gradient steps of an update, each with `batch_size` samples from the buffer. Each sample is
    thus used gradient_steps × batch_size / (train_freq × n_envs) times."""
    tau: float | None = None
    """Share of the networks in their targets at each update of these, above 0 and at most 1; null
    for 0.005 for `sac`, after each gradient step, and 1 for `dqn` and `qrdqn`."""
    target_update_interval: int = 10_000
    """Samples between two updates of the target network, rounded down to whole steps of all
    environments, one at least; for `dqn` and `qrdqn`."""
    exploration_fraction: float = 0.2
    """Share of the training during which the probability of random actions falls linearly; for
    `dqn` and `qrdqn`."""
    exploration_initial_eps: float = 1.0
    """Probability of a random action at the beginning; for `dqn` and `qrdqn`."""
    exploration_final_eps: float = 0.05
    """Probability of a random action after that share of the training; for `dqn` and `qrdqn`."""
    n_quantiles: int = 25
    """Quantiles of each action's return; for `qrdqn`. Time and memory of a gradient step grow with
    batch_size × n_quantiles²."""
    ent_coef: float | str = "auto_0.1"
    """Coefficient of the entropy in the return, a number from 0; or `auto_A`, which is learnt from
    A on, `auto` for A = 1; for `sac`."""
    target_entropy: float | None = None
    """Entropy (nats) that a learnt coefficient aims at; null for -1 per number of an action; for
    `sac`."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "buffer_size", "train_freq", "gradient_steps")
        check_fields(self, FROM_ONE, "learning_starts", "target_update_interval")
        check_fields(self, SHARE, "exploration_initial_eps", "exploration_final_eps")
        check_fields(self, _ABOVE_ZERO, "exploration_fraction")
        check_fields(self, _QUANTILES, "n_quantiles")
        if self.tau is not None:
            check_fields(self, _ABOVE_ZERO, "tau")
        if self.target_entropy is not None:
            check_fields(self, FINITE, "target_entropy")
        if not _is_coefficient(self.ent_coef):
            expected = "a number from 0, auto, or auto_A with A above 0"
            raise InputError("OffPolicyPlan.ent_coef", expected, str(self.ent_coef))


USERS = {
    **dict.fromkeys(
        ("buffer_size", "learning_starts", "train_freq", "gradient_steps", "tau"), OFF_POLICY
    ),
    **dict.fromkeys(
        (
            "target_update_interval",
            "exploration_fraction",
            "exploration_initial_eps",
            "exploration_final_eps",
        ),
        VALUE_BASED,
    ),
    "n_quantiles": ("qrdqn",),
    **dict.fromkeys(("ent_coef", "target_entropy"), ("sac",)),
}
"""The algorithms that use each field."""


def _is_coefficient(value: Any) -> bool:
    """Whether it is a coefficient of the entropy, in the notation of stable-baselines3."""
    if not isinstance(value, str):
        return value in NOT_NEGATIVE
    name, _, number = value.partition("_")
    try:
        return name == _AUTO and (value == _AUTO or 0 < float(number) < float("inf"))
    except ValueError:
        return False
