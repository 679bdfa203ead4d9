"""The part of a training plan that tells how claims are learnt."""

from __future__ import annotations

from dataclasses import dataclass

from albot_core.errors import InputError
from albot_core.ranges import FROM_ONE, SHARE, Range, check_fields

_ROBOTS = Range("a whole number from 2 to 100000", 2.0, 1e5, whole=True)
_RATE = Range("a number above 0, at most 1", 0.0, 1.0, beyond=True)
_SIZE = Range("a whole number from 1 to 4096", 1.0, 4096.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class ClaimsPlan:
    """Claims by a classifier of their own, learnt after the last sample of reinforcement learning.

    The policy drives, and at each step the simulator tells what a claim would be. Of each claim of
    the agent, this classifier then decides; how it drives stays as it was. Its samples do not
    count as samples of the training.
    """

    parts: tuple[str, ...] = ("matches",)
    """The parts of observations by which it decides. With all parts it learns the worlds by heart:
    a claim is a matter of how well the place matches, wherever it is."""
    units: int = 32
    """Units of each of its hidden layers; it has as many layers as the policy."""
    steps: int = 240_000
    """Number of samples, in all environments together."""
    n_envs: int = 80
    """Number of environments in which it is learnt; of each fifth, it is only measured."""
    probability: float = 0.95
    """The agent claims where a claim is right with more than this probability."""
    n_epochs: int = 20
    """Number of times that each sample is used."""
    batch_size: int = 512
    """Samples per gradient step."""
    learning_rate: float = 3e-3
    """Learning rate of Adam at the beginning, 1 at most; it falls linearly."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "steps", "n_epochs", "batch_size")
        check_fields(self, _ROBOTS, "n_envs")
        check_fields(self, _SIZE, "units")
        check_fields(self, _RATE, "learning_rate")
        check_fields(self, SHARE, "probability")
        if not 0 < self.probability < 1:
            found = str(self.probability)
            raise InputError("ClaimsPlan.probability", "a number between 0 and 1", found)
        if not self.parts or len(set(self.parts)) < len(self.parts):
            expected = "one part or more, each once"
            raise InputError("ClaimsPlan.parts", expected, ", ".join(self.parts) or "none")
        if self.steps < self.n_envs:
            expected = f"at least one of each environment, {self.n_envs}"
            raise InputError("ClaimsPlan.steps", expected, str(self.steps))

    @property
    def steps_each(self) -> int:
        """Steps of each environment."""
        return -(-self.steps // self.n_envs)
