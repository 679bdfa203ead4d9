"""The part of a training plan that tells how a policy learns from demonstrations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from albot_core.errors import InputError
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, SHARE, Range, check_fields

_ROBOTS = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)
_RATE = Range("a number above 0, at most 1", 0.0, 1.0, beyond=True)
_LOG_STD = Range("a number from -20 to 2", -20.0, 2.0)


@dataclass(frozen=True, kw_only=True)
class PretrainPlan:
    """Behaviour cloning of an agent, before the first sample of reinforcement learning.

    Demonstrations do not count as samples of the training.
    """

    agent: str = ""
    """The agent that demonstrates: a name as for `albot evaluate`, or the file of a trained agent.
    It may observe parts that the policy does not."""
    demonstrations: str = ""
    """A file of saved demonstrations, which replaces the agent: all of them are learnt."""
    steps: int = 200_000
    """Number of demonstrated samples, of all rounds together."""
    n_envs: int = 64
    """Number of environments in which is demonstrated; fewer see longer parts of episodes."""
    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of these environments that differ from those of the last stage."""
    rounds: int = 1
    """Rounds of DAgger (Ross, Gordon and Bagnell, AISTATS 2011), each with an equal share of
    `steps`. 1 is behaviour cloning. From the second round on the policy drives some environments,
    and the agent tells what it would do there."""
    beta: float = 0.5
    """The agent drives the share `beta` to the power of k in round k, counted from 0."""
    n_epochs: int = 20
    """Number of times that each sample is used after each round."""
    batch_size: int = 256
    """Samples per gradient step."""
    learning_rate: float = 1e-3
    """Learning rate of Adam, 1 at most."""
    said_share: float = 0.2
    """Least share in the loss of the samples in which the agent says something: declares home, or
    claims to know the place. Where it says both, each has half of it. They are rare; 0 lets each
    sample count the same."""
    vf_coef: float = 0.5
    """Coefficient of the value error in the loss; 0 to leave the value function as it is. It learns
    the discounted returns of the demonstrations."""
    log_std: float | None = None
    """Logarithm of the actions' standard deviation after cloning; None for what cloning found."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "steps", "rounds", "n_epochs", "batch_size")
        check_fields(self, _ROBOTS, "n_envs")
        check_fields(self, SHARE, "beta", "said_share")
        check_fields(self, _RATE, "learning_rate")
        check_fields(self, NOT_NEGATIVE, "vf_coef")
        if self.log_std is not None:
            check_fields(self, _LOG_STD, "log_std")
        if bool(self.agent) is bool(self.demonstrations):
            found = "both" if self.agent else "neither"
            raise InputError("PretrainPlan.agent", "an agent, or demonstrations instead", found)
        if self.demonstrations and self.rounds > 1:
            expected = "1, because nobody is there to tell what to do in later rounds"
            raise InputError("PretrainPlan.rounds", expected, str(self.rounds))
        if self.steps < self.rounds * self.n_envs:
            expected = (
                f"at least one of each environment in each round, {self.rounds * self.n_envs}"
            )
            raise InputError("PretrainPlan.steps", expected, str(self.steps))

    @property
    def steps_per_round(self) -> int:
        """Steps of each environment in a round."""
        return -(-self.steps // (self.rounds * self.n_envs))
