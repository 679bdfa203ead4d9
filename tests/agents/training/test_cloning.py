"""A policy that clones demonstrations, and the returns that its value function learns."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from gymnasium import spaces
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from stable_baselines3.common.policies import ActorCriticPolicy

from albot_agents.training import cloning
from albot_agents.training.cloning import LEAST_LOG_STD, Cloner
from albot_agents.training.demonstrations import (
    CUT,
    FAILED,
    GOES_ON,
    SUCCEEDED,
    Demonstrations,
)
from albot_agents.training.pretrain_plan import PretrainPlan
from albot_env.tasks.core.actions import MissionActionConfig
from tests.agents.training.demonstrated import ACTIONS, demonstrations

PLAN = PretrainPlan(agent="random", n_epochs=30, batch_size=128, learning_rate=0.01)
SPACES = (spaces.Box(-1, 1, (3,), np.float32), spaces.Box(-1, 1, (3,), np.float32))


def _policy(kind: Any = ActorCriticPolicy, **settings: Any) -> Any:
    torch.set_num_threads(1)  # As plans do: more only wait for each other.
    torch.manual_seed(0)
    return kind(*SPACES, lambda _: 1e-3, net_arch=[16], **settings)


def _learnt(policy: Any, given: Demonstrations, **changes: Any) -> dict[str, float]:
    plan = replace(PLAN, **changes)
    return Cloner(policy, plan, 0.9, ACTIONS).learn(given, np.random.default_rng(0))


def test_a_return_is_the_sum_of_discounted_rewards_of_its_episode() -> None:
    after = [[GOES_ON, SUCCEEDED, GOES_ON, FAILED], [GOES_ON, CUT, GOES_ON, CUT]]
    given = demonstrations(
        rewards=np.array(((1, 2, 4, 8), (1, 2, 4, 8)), np.float32), after=np.array(after, np.uint8)
    )
    returns, known = given.returns(0.5)
    np.testing.assert_allclose(returns, [[2, 2, 8, 8]] * 2)
    np.testing.assert_array_equal(known, [[True] * 4, [False] * 4])
    assert given.success_rate == pytest.approx(1 / 3)  # The end of the round ends no episode.
    by_time = demonstrations(after=np.array([[GOES_ON, CUT, GOES_ON, CUT]], np.uint8))
    assert by_time.success_rate is None


def test_what_comes_after_a_cut_matters_less_the_farther_it_is() -> None:
    given = demonstrations(rewards=np.ones((1, 10), np.float32))
    _, known = given.returns(0.5)
    # The reward after the cut weighs 0.5, 0.25, …: at the fifth step from the end, 1/32.
    np.testing.assert_array_equal(known[0], np.arange(10) < 6)


def _rule(count: int, seed: int) -> Demonstrations:
    """Turn by the sign of the first number; declare where the second, rarely, is near 1."""
    rng = np.random.default_rng(seed)
    seen = rng.uniform(-1, 1, (8, count // 8, 3)).astype(np.float16)
    actions = np.full((*seen.shape[:2], 3), -1.0, np.float32)
    actions[..., 1] = np.sign(seen[..., 0]) / 2
    actions[..., 2] = np.where(seen[..., 1] > 0.96, 1.0, -1.0)
    returns = 10 * seen[..., 2].astype(np.float32)
    after = np.full(seen.shape[:2], SUCCEEDED, np.uint8)
    return demonstrations(observations=seen, actions=actions, rewards=returns, after=after)


def test_what_is_rarely_said_has_its_share_in_the_loss() -> None:
    """Where it is said at random, the likeliest mean action is twice its share, minus 1."""
    said = np.random.default_rng(0).permutation(np.arange(1000) < 20).reshape(4, 250)
    actions = np.full((4, 250, 3), -1.0, np.float32)
    actions[..., 2] = np.where(said, 1.0, -1.0)
    given = demonstrations(actions=actions)
    np.testing.assert_array_equal(given.said(ACTIONS)["declare"], said)
    for share, mean in ((0.0, -0.96), (0.01, -0.96), (0.2, -0.6)):
        policy = _policy()
        _learnt(policy, given, said_share=share, learning_rate=0.003)
        action, _ = policy.predict(np.zeros((1, 3), np.float32), deterministic=True)
        assert action[0, 2] == pytest.approx(mean, abs=0.05)


def test_what_is_said_once_is_not_drowned_by_what_is_said_often() -> None:
    """A claim in every third sample, home in one of 250: each has a tenth of the loss or more."""
    numbers = np.arange(1000)
    declared, claimed = numbers % 250 == 0, numbers % 3 == 1
    actions = np.full((4, 250, 4), -1.0, np.float32)
    actions[..., 2] = np.where(declared, 1.0, -1.0).reshape(4, 250)
    actions[..., 3] = np.where(claimed, 1.0, -1.0).reshape(4, 250)
    config = MissionActionConfig()
    said = demonstrations(actions=actions).said(config)
    np.testing.assert_array_equal(said["declare"].ravel(), declared)
    np.testing.assert_array_equal(said["claim"].ravel(), claimed)
    flags = [each.ravel() for each in said.values()]
    weights = cloning._weights(flags, declared | claimed, 0.2)
    assert weights.mean() == pytest.approx(1.0)
    assert weights[declared].sum() / 1000 == pytest.approx(0.1, abs=0.03)
    assert weights[claimed].sum() / 1000 > 0.2
    assert (weights > 0).all()
    np.testing.assert_array_equal(cloning._weights(flags, np.ones(1000, np.bool_), 0.2), 1.0)


def test_the_value_function_learns_the_returns_or_is_left_alone() -> None:
    given = _rule(2000, 1)
    seen = torch.from_numpy(given.observations.reshape(-1, 3).astype(np.float32))
    policy = _policy()
    before = policy.predict_values(seen).detach()
    _learnt(policy, given, vf_coef=0.0, n_epochs=1)
    torch.testing.assert_close(policy.predict_values(seen), before)
    error = _learnt(policy, given, n_epochs=20)["value_error"]
    assert error < 0.1 * float(given.rewards.var())


def test_the_spread_of_actions_becomes_that_of_the_demonstrations_but_not_too_small() -> None:
    given = _rule(2000, 1)
    noise = np.random.default_rng(0).normal(0, 0.3, given.rewards.shape)
    actions = given.actions.copy()
    actions[..., 0] = noise
    policy = _policy()
    _learnt(policy, replace(given, actions=actions))
    spread = policy.log_std.detach().numpy()
    assert np.exp(spread[0]) == pytest.approx(0.3, rel=0.15)
    assert spread.min() >= LEAST_LOG_STD


def _recall(steps: int) -> Demonstrations:
    """Turn by the sign of what was seen when the episode began."""
    rng = np.random.default_rng(3)
    begins = np.zeros((16, steps), np.bool_)
    begins[:, ::5] = True
    side = np.where(rng.random((16, steps)) < 0.5, -1.0, 1.0)
    seen = np.zeros((16, steps, 3), np.float16)
    seen[..., 0] = np.where(begins, side, 0.0)
    first = np.arange(steps) // 5 * 5
    actions = np.zeros((16, steps, 3), np.float32)
    actions[..., 1] = side[:, first] / 2
    actions[..., 2] = -1.0
    return demonstrations(observations=seen, actions=actions, begins=begins)


def test_a_policy_with_a_memory_learns_what_must_be_remembered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cloning, "PIECE", 3)  # What is to be remembered was in the piece before.
    given = _recall(20)
    with_memory = _policy(RecurrentActorCriticPolicy, lstm_hidden_size=16)
    without = _learnt(_policy(), given)["log_likelihood"]
    assert _learnt(with_memory, given, batch_size=48)["log_likelihood"] > without + 1.0
    state, wrong = None, 0
    for step in range(20):
        seen = given.observations[:, step].astype(np.float32)
        mean, state = with_memory.predict(seen, state, given.begins[:, step], deterministic=True)
        wrong += (np.sign(mean[:, 1]) != np.sign(given.actions[:, step, 1])).sum()
    assert wrong < 0.05 * 20 * 16
