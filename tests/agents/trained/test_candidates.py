"""Policies that weigh candidates, in PyTorch and in numpy."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_agents.trained.network import Network, NetworkConfig
from albot_agents.training.checkpoint import policy_weights
from albot_agents.training.learner import DeepSetsPolicy, make_learner
from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_core.errors import InputError

MOST, WIDTH = 6, 4
"""Candidates that there can be, and numbers of each."""
ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU}


def _policy(layers: tuple[int, ...], activation: str) -> DeepSetsPolicy:
    torch.manual_seed(3)
    policy = DeepSetsPolicy(
        Box(-1, 1, (MOST * (WIDTH + 1),), np.float32),
        Discrete(MOST + 1),
        lambda _: 1e-3,
        net_arch={"pi": list(layers), "vf": [5]},
        activation_fn=ACTIVATIONS[activation],
    )
    for parameter in policy.parameters():  # As large as training makes them, biases too.
        torch.nn.init.normal_(parameter, std=0.7)
    return policy


def _network(policy: DeepSetsPolicy, layers: tuple[int, ...], activation: str) -> Network:
    config = NetworkConfig(
        inputs=MOST * (WIDTH + 1),
        layers=layers,
        activation=activation,
        outputs=MOST + 1,
        candidates=MOST,
    )
    state = {name: value.detach().numpy() for name, value in policy.state_dict().items()}
    plan = TrainingPlan(policy=PolicyPlan(kind="candidates", net_arch=layers))
    weights = policy_weights(state, plan)
    assert {name: array.shape for name, array in weights.items()} == config.shapes
    return Network(config, weights)


def _observed(rows: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Observations of candidates (…, MOST, WIDTH) of which those are `there` (…, MOST)."""
    mask = np.where(there, 1, -1)
    return np.concatenate((rows.reshape(*rows.shape[:-2], -1), mask), axis=-1).astype(np.float32)


def _drawn(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Candidates, from none at all to as many as there can be; what is not there is no 0."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-1, 1, (count, MOST, WIDTH)).astype(np.float32)
    return rows, np.arange(MOST) < (np.arange(count) % (MOST + 1))[:, np.newaxis]


@pytest.mark.parametrize("activation", ["tanh", "relu", "elu"])
@pytest.mark.parametrize("layers", [(16, 8), ()])
def test_candidates_are_weighed_as_by_the_original(
    activation: str, layers: tuple[int, ...]
) -> None:
    policy = _policy(layers, activation)
    network = _network(policy, layers, activation)
    rows, there = _drawn(1, 70)
    observed = _observed(rows, there)
    with torch.no_grad():
        chances = policy.get_distribution(torch.from_numpy(observed)).distribution.probs.numpy()
    weighed = np.array([network(row) for row in observed], np.float64)
    found = np.exp(weighed - weighed.max(axis=1, keepdims=True))
    np.testing.assert_allclose(found / found.sum(axis=1, keepdims=True), chances, atol=1e-5)
    answers, _ = policy.predict(observed, deterministic=True)
    assert weighed.argmax(axis=1).tolist() == answers.tolist()
    assert len(set(answers.tolist())) > 3


NETWORK = _network(_policy((9,), "tanh"), (9,), "tanh")


@given(st.integers(0, 2**32 - 1), st.permutations(range(MOST)))
@settings(deadline=None, max_examples=60)
def test_the_order_of_candidates_does_not_matter(seed: int, order: list[int]) -> None:
    rng = np.random.default_rng(seed)
    rows, there = rng.uniform(-1, 1, (MOST, WIDTH)), rng.random(MOST) < 0.6
    new, *each = NETWORK(_observed(rows, there))
    again, *moved = NETWORK(_observed(rows[order], there[order]))
    assert again == pytest.approx(new, abs=1e-6)
    assert moved == pytest.approx(np.array(each)[order], abs=1e-6)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_what_is_not_there_does_not_count(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, there = rng.uniform(-1, 1, (2, MOST, WIDTH)), rng.random(MOST) < 0.5
    rows[1][there] = rows[0][there]
    one, other = NETWORK(_observed(rows[0], there)), NETWORK(_observed(rows[1], there))
    np.testing.assert_array_equal(one, other)
    assert (one[1:][~there] < one[0] - 1e6).all()


def test_it_learns_by_gradients_that_are_finite() -> None:
    """Also where nothing is there, and where "none" hangs on what is pooled."""
    policy = _policy((8,), "relu")
    rows, there = _drawn(2, 14)
    observed = torch.from_numpy(_observed(rows, there))
    values, chance, entropy = policy.evaluate_actions(observed, torch.zeros(14))
    assert entropy is not None
    (values.sum() + chance.sum() + entropy.sum()).backward()  # type: ignore[no-untyped-call]
    for name, parameter in policy.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.isfinite().all(), name
        assert parameter.grad.abs().sum() > 0, name


class _Which(gymnasium.Env[np.ndarray, np.int64]):
    """Which candidate has the largest first number, or none where that is below 0."""

    observation_space = Box(-1, 1, (MOST * (WIDTH + 1),), np.float32)
    action_space = Discrete(MOST + 1)

    def __init__(self) -> None:
        self._right = 0

    def reset(self, **options: Any) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(**options)
        return self._draw(), {}

    def step(self, action: np.int64) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        reward = 1.0 if int(action) == self._right else -1.0
        return self._draw(), reward, True, False, {}

    def _draw(self) -> np.ndarray:
        rng = self.np_random
        rows, count = rng.uniform(-1, 1, (MOST, WIDTH)), int(rng.integers(1, 4))
        there = np.arange(MOST) < count
        best = int(np.argmax(np.where(there, rows[:, 0], -2)))
        self._right = best + 1 if rows[best, 0] > 0 else 0
        return _observed(rows, there)


def test_it_learns_which_one_it_is() -> None:
    """A task whose answer is known, learnt in a second from rewards alone."""
    from stable_baselines3.common.vec_env import DummyVecEnv

    plan = TrainingPlan(
        n_envs=16, n_steps=16, batch_size=128, n_epochs=8, gamma=0.0, learning_rate=0.02,
        n_timesteps=4096, policy=PolicyPlan(kind="candidates", net_arch=(8,)),
    )  # fmt: skip
    envs = DummyVecEnv([_Which] * 16)
    learner = make_learner(plan, envs)
    learner.learn(plan.n_timesteps)
    observed, rewards = envs.reset(), []
    for _ in range(50):
        answers, _ = learner.predict(observed, deterministic=True)  # type: ignore[arg-type]
        observed, got, *_ = envs.step(answers)
        rewards.extend(got)
    assert np.mean(rewards) > 0.85


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"candidates": 7}, "inputs"),
        ({"candidates": 5}, "outputs"),
        ({"candidates": 30}, "inputs"),
        ({"candidates": -1}, "candidates"),
        ({"lstm_layers": 1, "lstm_size": 3}, "lstm_layers"),
        ({"sampled": True}, "sampled"),
        ({"outputs": 6}, "outputs"),
    ],
)
def test_candidates_that_do_not_fit_are_refused(changes: dict[str, int], field: str) -> None:
    fields: dict[str, Any] = {"inputs": 30, "layers": (4,), "activation": "tanh", "outputs": 7}
    NetworkConfig(**fields, candidates=6)
    with pytest.raises(InputError, match=rf"NetworkConfig\.{field}: "):
        NetworkConfig(**{**fields, "candidates": 6, **changes})
