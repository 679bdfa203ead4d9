"""Behaviour cloning: a policy learns to act as demonstrated.

The policy is that of the learner, so reinforcement learning goes on from it. The loss is the
negative log-likelihood of the demonstrated actions; beside it, the value function learns the
discounted returns of the demonstrations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.policies import ActorCriticPolicy

from albot_agents.training.demonstrations import Demonstrations
from albot_agents.training.pretrain_plan import PretrainPlan
from albot_env.tasks.core.actions import ActionConfig

LEAST_LOG_STD = -2.0
"""Least logarithm of a standard deviation: with a smaller one, a step of reinforcement learning
would change the probability of what it did by powers of ten."""
PIECE = 64
"""Steps of the pieces into which sequences are cut for a policy with a memory."""
_LARGEST_GRADIENT = 1.0

_Rows = Int64[np.ndarray, "samples"]


class Cloner:
    """Lets a policy learn from demonstrations.

    Args:
        policy: The policy, with or without an LSTM.
        plan: How it learns.
        gamma: Discount factor per step.
        actions: What the numbers of an action stand for.
    """

    def __init__(
        self, policy: ActorCriticPolicy, plan: PretrainPlan, gamma: float, actions: ActionConfig
    ) -> None:
        self._policy, self._plan, self._gamma, self._actions = policy, plan, gamma, actions
        self._optimizer = torch.optim.Adam(policy.parameters(), lr=plan.learning_rate)

    def learn(
        self,
        demonstrations: Demonstrations,
        rng: np.random.Generator,
        report: Callable[[str], None] = lambda note: None,
    ) -> dict[str, float]:
        """Learn from demonstrations; return means over the last epoch.

        These are `log_likelihood` of an action, `said_log_likelihood` of those in which the agent
        says something, if it does, and the squared `value_error` of the returns that are known.

        Args:
            demonstrations: The demonstrations.
            rng: Draws the order of the samples.
            report: Called with the progress as text.
        """
        data = _Data(demonstrations, self._plan, self._gamma, self._actions)
        self._policy.set_training_mode(True)
        means: dict[str, float] = {}
        for epoch in range(self._plan.n_epochs):
            means = data.means(list(self._epoch(data, rng)))
            note = f"epoch {epoch + 1} of {self._plan.n_epochs}"
            report(f"{note}, log-likelihood {means['log_likelihood']:.2f}")
        self._policy.set_training_mode(False)
        return means

    def _epoch(self, data: _Data, rng: np.random.Generator) -> Iterator[tuple[_Rows, np.ndarray]]:
        """Use each sample once; yield the rows, their log-likelihoods and squared value errors."""
        recurrent = isinstance(self._policy, RecurrentActorCriticPolicy)
        for batch in (self._pieces if recurrent else self._samples)(data, rng):
            rows, present, values, log_likelihoods = batch
            weights, returns, known = (
                self._tensor(array[rows]) for array in (data.weights, data.returns, data.known)
            )
            errors = known * (values.flatten() - returns) ** 2
            losses = self._plan.vf_coef * errors - weights * log_likelihoods
            loss = losses[self._tensor(present)].mean()
            self._optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self._policy.parameters(), _LARGEST_GRADIENT)
            self._optimizer.step()
            keep_spread(self._policy)
            figures = torch.stack((log_likelihoods, errors)).detach().cpu().numpy()
            yield rows[present], figures[:, present]

    def _samples(self, data: _Data, rng: np.random.Generator) -> Iterator[tuple[Any, ...]]:
        """Evaluate batches of samples in any order."""
        order = rng.permutation(data.count)
        for begin in range(0, data.count, self._plan.batch_size):
            rows = order[begin : begin + self._plan.batch_size]
            values, log_likelihoods, _ = self._policy.evaluate_actions(*self._seen(data, rows))
            yield rows, np.ones(len(rows), np.bool_), values, log_likelihoods

    def _pieces(self, data: _Data, rng: np.random.Generator) -> Iterator[tuple[Any, ...]]:
        """Evaluate pieces of several episodes, each with the state that its predecessor ended with.

        The gradient does not reach back into that. Episodes of about the same length go together;
        the shorter ones are filled up with samples that are not present.
        """
        policy: Any = self._policy
        layers, _, units = policy.lstm_hidden_state_shape
        for first, lengths in data.episodes(max(1, self._plan.batch_size // PIECE), rng):
            zeros = torch.zeros(layers, len(first), units, device=policy.device)
            states = RNNStates((zeros, zeros), (zeros, zeros))
            for begin in range(0, int(lengths.max()), PIECE):
                steps = np.arange(begin, min(begin + PIECE, int(lengths.max())))
                present = (steps < lengths[:, np.newaxis]).ravel()
                held = np.minimum(steps, lengths[:, np.newaxis] - 1)
                rows = (first[:, np.newaxis] + held).ravel()
                seen, actions = self._seen(data, rows)
                # No episode begins within a piece, which lets an LSTM take it as a whole.
                begins = torch.zeros(len(rows), device=policy.device)
                values, log_likelihoods, _ = policy.evaluate_actions(seen, actions, states, begins)
                yield rows, present, values, log_likelihoods
                with torch.no_grad():
                    *_, states = policy.forward(seen, states, begins, deterministic=True)

    def _seen(self, data: _Data, rows: _Rows) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the observations and actions of some samples."""
        observations = data.observations[rows].astype(np.float32)
        return self._tensor(observations), self._tensor(data.actions[rows])

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(array).to(self._policy.device)


class _Data:
    """Demonstrations as rows, one per sample, with what is computed from them."""

    def __init__(
        self, given: Demonstrations, plan: PretrainPlan, gamma: float, actions: ActionConfig
    ) -> None:
        self.count = given.count
        self.observations = given.observations.reshape(self.count, -1)
        self.actions = given.actions.reshape(self.count, *given.actions.shape[2:])
        self._first = np.flatnonzero(given.begins.ravel())
        self._lengths = np.diff(self._first, append=self.count)
        returns, known = given.returns(gamma)
        self.returns, self.known = returns.ravel(), known.ravel().astype(np.float32)
        said = [samples.ravel() for samples in given.said(actions).values()]
        self.said = np.any([np.zeros(self.count, np.bool_), *said], axis=0)
        self.weights = _weights(said, self.said, plan.said_share)

    def episodes(
        self, together: int, rng: np.random.Generator
    ) -> Iterator[tuple[_Rows, Int64[np.ndarray, "episodes"]]]:
        """Yield the first rows and the lengths of some episodes at a time, in any order."""
        order = rng.permutation(len(self._first))
        order = order[np.argsort(self._lengths[order], kind="stable")]
        groups = np.array_split(order, -(-len(order) // together))
        for k in rng.permutation(len(groups)):
            yield self._first[groups[k]], self._lengths[groups[k]]

    def means(self, batches: list[tuple[_Rows, np.ndarray]]) -> dict[str, float]:
        """Return the means of an epoch."""
        rows = np.concatenate([rows for rows, _ in batches])
        likelihoods, errors = np.concatenate([figures for _, figures in batches], axis=1)
        means = {"log_likelihood": float(likelihoods.mean())}
        if self.said.any():
            means["said_log_likelihood"] = float(likelihoods[self.said[rows]].mean())
        if self.known.any():
            means["value_error"] = float(errors.sum() / self.known.sum())
        return means


def _weights(
    said: list[Bool[np.ndarray, "samples"]], any_said: Bool[np.ndarray, "samples"], least: float
) -> Float32[np.ndarray, "samples"]:
    """Return the weights of samples in the loss, 1 on average.

    Each statement that is said at all has its part of the share `least`: else one that is said
    often, such as a claim, would leave nothing to one that is said once an episode.
    """
    said = [samples for samples in said if samples.any()]
    rest = 1.0 - any_said.mean()
    if not said or rest == 0.0:
        return np.ones(len(any_said), np.float32)
    weights = np.full(len(any_said), (1.0 - least) / rest)
    for samples in said:
        weights[samples] = np.maximum(weights[samples], least / len(said) / samples.mean())
    return np.asarray(weights / weights.mean(), np.float32)


def keep_spread(policy: ActorCriticPolicy) -> None:
    """Raise the standard deviations of actions to the least one, where they are smaller."""
    spread = getattr(policy, "log_std", None)  # Discrete actions have none.
    if spread is not None:
        with torch.no_grad():
            spread.clamp_(min=LEAST_LOG_STD)
