"""Networks in numpy against stable-baselines3's own predictions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.qrdqn.policies import QRDQNPolicy
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.dqn.policies import DQNPolicy
from stable_baselines3.sac.policies import SACPolicy

from albot_agents.trained.network import Network, NetworkConfig
from albot_agents.training.checkpoint import policy_weights
from albot_agents.training.off_policy_plan import OffPolicyPlan
from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_core.errors import InputError

LENGTH = 13
ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU}


def _network(policy: Any, plan: TrainingPlan, outputs: int) -> Network:
    recurrent = plan.recurrent
    config = NetworkConfig(
        inputs=LENGTH,
        layers=plan.policy.net_arch,
        activation=plan.policy.activation,
        outputs=outputs,
        sampled=plan.policy.sampled,
        sampled_statements=plan.policy.sampled_statements,
        lstm_size=plan.policy.lstm_size if recurrent else 0,
        lstm_layers=plan.policy.lstm_layers if recurrent else 0,
        squashed=plan.algorithm == "sac",
    )
    state = {name: value.numpy() for name, value in policy.state_dict().items()}
    weights = policy_weights(state, plan)
    assert {name: array.shape for name, array in weights.items()} == config.shapes
    return Network(config, weights)


def _policy(kind: Any, plan: TrainingPlan, actions: Any, **settings: Any) -> Any:
    torch.manual_seed(3)
    policy = kind(
        Box(-1, 1, (LENGTH,), np.float32),
        actions,
        lambda _: 1e-3,
        net_arch=list(plan.policy.net_arch),
        activation_fn=ACTIVATIONS[plan.policy.activation],
        **settings,
    )
    for parameter in policy.parameters():  # As large as training makes them, biases too.
        torch.nn.init.normal_(parameter, std=0.5)
    return policy


@pytest.mark.parametrize("activation", ["tanh", "relu", "elu"])
@pytest.mark.parametrize("layers", [(16, 8), ()])
def test_an_mlp_does_as_its_original(activation: str, layers: tuple[int, ...]) -> None:
    plan = TrainingPlan(policy=PolicyPlan(net_arch=layers, activation=activation))
    policy = _policy(ActorCriticPolicy, plan, Box(-1, 1, (3,), np.float32), ortho_init=False)
    network = _network(policy, plan, 3)
    rows = np.random.default_rng(1).uniform(-1, 1, (40, LENGTH)).astype(np.float32)
    expected, _ = policy.predict(rows, deterministic=True)
    found = np.array([np.clip(network(row), -1, 1) for row in rows])
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert 0.05 < (np.abs(expected) < 1).mean() < 1  # Some are clipped, some are not.


@pytest.mark.parametrize("says", [True, False])
def test_numbers_are_drawn_as_by_its_original(says: bool) -> None:
    plan = TrainingPlan(policy=PolicyPlan(net_arch=(16,), sampled=True, sampled_statements=says))
    policy = _policy(ActorCriticPolicy, plan, Box(-1, 1, (3,), np.float32), ortho_init=False)
    network, rng = _network(policy, plan, 3), np.random.default_rng(4)
    row = rng.uniform(-1, 1, LENGTH).astype(np.float32)
    drawn = np.array([network.sample(network(row), rng) for _ in range(20_000)])
    original = policy.get_distribution(torch.tensor(row[np.newaxis])).distribution
    mean, deviation = (tensor.detach().numpy()[0] for tensor in (original.mean, original.stddev))
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.05)
    spread = deviation * (1, 1, says)
    np.testing.assert_allclose(drawn.std(axis=0), spread, rtol=0.03, atol=1e-3)


def test_a_discrete_policy_chooses_as_its_original() -> None:
    plan = TrainingPlan(policy=PolicyPlan(net_arch=(16,)))
    policy = _policy(ActorCriticPolicy, plan, Discrete(5), ortho_init=False)
    network = _network(policy, plan, 5)
    rows = np.random.default_rng(1).uniform(-1, 1, (40, LENGTH)).astype(np.float32)
    expected, _ = policy.predict(rows, deterministic=True)
    assert [int(np.argmax(network(row))) for row in rows] == expected.tolist()
    assert len(set(expected.tolist())) > 2


@pytest.mark.parametrize("activation", ["tanh", "relu", "elu"])
@pytest.mark.parametrize("layers", [(16, 8), ()])
def test_a_soft_actor_does_as_its_original(activation: str, layers: tuple[int, ...]) -> None:
    plan = TrainingPlan(algorithm="sac", policy=PolicyPlan(net_arch=layers, activation=activation))
    policy = _policy(SACPolicy, plan, Box(-1, 1, (3,), np.float32))
    network = _network(policy, plan, 3)
    rows = np.random.default_rng(1).uniform(-1, 1, (40, LENGTH)).astype(np.float32)
    expected, _ = policy.predict(rows, deterministic=True)
    found = np.array([network(row) for row in rows])
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert np.abs(expected).max() > 0.7  # Far from where tanh is a line.


@pytest.mark.parametrize("layers", [(16, 8), ()])
def test_values_of_actions_are_as_by_their_original(layers: tuple[int, ...]) -> None:
    own = {"dqn": OffPolicyPlan(), "qrdqn": OffPolicyPlan(n_quantiles=7)}
    for algorithm, kind, settings in (
        ("dqn", DQNPolicy, {}),
        ("qrdqn", QRDQNPolicy, {"n_quantiles": 7}),
    ):
        plan = TrainingPlan(
            algorithm=algorithm,
            policy=PolicyPlan(net_arch=layers),
            off_policy=own[algorithm],
        )
        policy = _policy(kind, plan, Discrete(5), **settings)
        network = _network(policy, plan, 5)
        rows = np.random.default_rng(1).uniform(-1, 1, (40, LENGTH)).astype(np.float32)
        with torch.no_grad():
            if algorithm == "dqn":
                values = policy.q_net(torch.from_numpy(rows)).numpy()
            else:  # One row of actions for each quantile.
                values = policy.quantile_net(torch.from_numpy(rows)).mean(dim=1).numpy()
        found = np.array([network(row) for row in rows])
        np.testing.assert_allclose(found, values, atol=1e-5)
        expected, _ = policy.predict(rows, deterministic=True)
        assert found.argmax(axis=1).tolist() == expected.tolist()
        assert len(set(expected.tolist())) > 2


@pytest.mark.parametrize("layers", [1, 2])
def test_an_lstm_remembers_as_its_original(layers: int) -> None:
    plan = TrainingPlan(
        algorithm="recurrent_ppo",
        policy=PolicyPlan(net_arch=(6,), lstm_size=7, lstm_layers=layers),
    )
    settings = {"lstm_hidden_size": 7, "n_lstm_layers": layers, "ortho_init": False}
    space = Box(-1, 1, (2,), np.float32)
    policy = _policy(RecurrentActorCriticPolicy, plan, space, **settings)
    network = _network(policy, plan, 2)
    rows = np.random.default_rng(2).uniform(-1, 1, (60, LENGTH)).astype(np.float32)
    state, answers = None, []
    for k, row in enumerate(rows):
        begins = k % 20 == 0
        if begins:
            network.reset()
        expected, state = policy.predict(row, state, np.array([begins]), deterministic=True)
        answers.append(network(row))
        np.testing.assert_allclose(np.clip(answers[-1], -1, 1), expected, atol=1e-5)
    network.reset()
    assert not np.allclose(network(rows[5]), answers[5], atol=1e-3)  # It does remember.


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"inputs": 0}, "inputs"),
        ({"inputs": 10**9}, "inputs"),
        ({"layers": (0,)}, "layers"),
        ({"layers": (4,) * 9}, "layers"),
        ({"activation": "sine"}, "activation"),
        ({"lstm_size": 4}, "lstm_size"),
        ({"lstm_layers": 1}, "lstm_size"),
        ({"squashed": True, "sampled": True}, "sampled"),
    ],
)
def test_what_is_no_network_is_refused(changes: dict[str, Any], place: str) -> None:
    fields = {"inputs": 4, "layers": (4,), "activation": "tanh", "outputs": 2, **changes}
    with pytest.raises(InputError, match=rf"NetworkConfig\.{place}"):
        NetworkConfig(**fields)
