"""A PPO loop in the shape of CleanRL's, over each kind of vector environment of gymnasium."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import (
    NormalizeReward,
    RecordEpisodeStatistics,
    RecordVideo,
    RescaleAction,
)
from torch import nn

from tests.env.libraries.conftest import EXPLORE, Clip

ENVIRONMENT = "Albot/Explore-v0"
ENVIRONMENTS, ROLLOUT, UPDATES = 3, 8, 2
GAMMA, LAMBDA, CLIP = 0.99, 0.95, 0.2


class Agent(nn.Module):
    """A policy with a normal distribution, and a value."""

    def __init__(self, envs: Any) -> None:
        super().__init__()
        length = int(np.prod(envs.single_observation_space.shape))
        self.value = nn.Sequential(nn.Linear(length, 8), nn.Tanh(), nn.Linear(8, 1))
        self.mean = nn.Linear(length, int(np.prod(envs.single_action_space.shape)))
        self.log_deviation = nn.Parameter(torch.zeros(envs.single_action_space.shape))

    def distribution(self, observations: torch.Tensor) -> torch.distributions.Normal:
        return torch.distributions.Normal(self.mean(observations), self.log_deviation.exp())


def _batch(mode: AutoresetMode) -> Any:
    return gymnasium.make_vec(ENVIRONMENT, num_envs=ENVIRONMENTS, autoreset_mode=mode, **EXPLORE)


def _sync(mode: AutoresetMode) -> Any:
    makes = [lambda: gymnasium.make(ENVIRONMENT, **EXPLORE)] * ENVIRONMENTS
    return gymnasium.vector.SyncVectorEnv(makes, autoreset_mode=mode)


def _advantages(
    rewards: torch.Tensor, values: torch.Tensor, ends: torch.Tensor, last: torch.Tensor
) -> torch.Tensor:
    """Generalised advantages; an end cuts what comes after."""
    found, following, ahead = torch.zeros_like(rewards), last, torch.zeros_like(last)
    for step in reversed(range(ROLLOUT)):
        going_on = 1.0 - ends[step]
        error = rewards[step] + GAMMA * following * going_on - values[step]
        ahead = error + GAMMA * LAMBDA * going_on * ahead
        found[step], following = ahead, values[step]
    return found


def _learn(envs: Any, agent: Agent) -> list[dict[str, Any]]:
    """Learn for a few rollouts; return the infos of the steps that ended episodes."""
    optimizer = torch.optim.Adam(agent.parameters(), lr=1e-3)
    over: list[dict[str, Any]] = []
    seen = torch.as_tensor(envs.reset(seed=1)[0])
    for _ in range(UPDATES):
        kept: dict[str, list[torch.Tensor]] = {
            name: [] for name in ("seen", "actions", "logs", "rewards", "values", "ends")
        }
        for _ in range(ROLLOUT):
            with torch.no_grad():
                normal, value = agent.distribution(seen), agent.value(seen)[:, 0]
                action = normal.sample()
            following, reward, terminated, truncated, infos = envs.step(action.numpy())
            ends = terminated | truncated
            if ends.any():
                over.append(infos)
            step = (
                seen,
                action,
                normal.log_prob(action).sum(1),
                torch.as_tensor(reward, dtype=torch.float32),
                value,
                torch.as_tensor(ends, dtype=torch.float32),
            )
            for name, part in zip(kept, step, strict=True):
                kept[name].append(part)
            seen = torch.as_tensor(following)
        rollout = {name: torch.stack(parts) for name, parts in kept.items()}
        with torch.no_grad():
            last = agent.value(seen)[:, 0]
        advantages = _advantages(rollout["rewards"], rollout["values"], rollout["ends"], last)
        logs = agent.distribution(rollout["seen"]).log_prob(rollout["actions"]).sum(-1)
        ratio = (logs - rollout["logs"]).exp()
        surrogate = torch.min(ratio * advantages, ratio.clamp(1 - CLIP, 1 + CLIP) * advantages)
        errors = agent.value(rollout["seen"])[..., 0] - (advantages + rollout["values"])
        optimizer.zero_grad()
        (errors.square().mean() - surrogate.mean()).backward()
        optimizer.step()
    return over


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("make", [_batch, _sync])
def test_a_loop_learns_and_sees_how_episodes_end(
    make: Callable[[AutoresetMode], Any], mode: AutoresetMode
) -> None:
    envs = RescaleAction(RecordEpisodeStatistics(make(mode)), np.float32(-1), np.float32(1))
    agent = Agent(envs)
    before = [weights.detach().clone() for weights in agent.parameters()]
    over = _learn(envs, agent)
    after = agent.parameters()
    assert all(not old.equal(new) for old, new in zip(before, after, strict=True))
    assert len(over) == ROLLOUT * UPDATES // (6 if mode is AutoresetMode.SAME_STEP else 7)
    for infos in over:
        final = infos["final_info"] if mode is AutoresetMode.SAME_STEP else infos
        assert final["coverage"].shape == (ENVIRONMENTS,) and final["_coverage"].all()
        assert (infos["episode"]["l"] == 6).all()
        if mode is AutoresetMode.SAME_STEP:
            assert infos["final_obs"][0].shape == envs.single_observation_space.shape
    envs.close()


def test_a_batch_takes_the_wrappers_of_vectors() -> None:
    envs = NormalizeReward(_batch(AutoresetMode.NEXT_STEP))
    assert envs.unwrapped.autoreset_mode is AutoresetMode.NEXT_STEP
    envs.reset(seed=1)
    assert envs.step(envs.action_space.sample())[1].shape == (ENVIRONMENTS,)


def test_a_batch_is_filmed(clips: list[Clip], tmp_path: Path) -> None:
    """Each frame is a grid of pictures, which are those of single environments."""
    envs = gymnasium.make_vec(ENVIRONMENT, num_envs=4, render_mode="rgb_array", **EXPLORE)
    single: Any = gymnasium.make(ENVIRONMENT, render_mode="rgb_array", **EXPLORE)
    film = RecordVideo(envs, str(tmp_path / "films"), episode_trigger=lambda episode: episode == 0)
    film.reset(seed=1)
    single.reset(seed=3)
    pictures = [single.render()]
    for _ in range(7):
        film.step(np.full((4, 3), 0.5, np.float32))
        if len(pictures) < 7:  # Then the episode is over, and the next step resets.
            single.step(np.full(3, 0.5, np.float32))
            pictures.append(single.render())
    film.close()
    (clip,) = clips
    height, width, _ = pictures[0].shape
    assert (len(clip.frames), clip.fps) == (7, 10)
    for frame, picture in zip(clip.frames, pictures, strict=True):
        np.testing.assert_array_equal(frame[height:, :width], picture)  # That of the third.


def test_rendering_before_a_reset_is_an_error() -> None:
    envs = gymnasium.make_vec(ENVIRONMENT, num_envs=2, render_mode="rgb_array", **EXPLORE)
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.render()
    assert _batch(AutoresetMode.NEXT_STEP).render() is None
