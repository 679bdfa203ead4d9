"""Recorded episodes of short drives."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_env.recording.writer import EpisodeWriter

Recorded = tuple[Path, dict[str, Any]]
"""An episode's file, and what the environment gave when it was recorded."""


def record_episode(
    folder: Path, task: str, name: str = "a.mcap", seed: int = 3, **settings: Any
) -> Recorded:
    """Record an episode of chance."""
    env = gymnasium.make(task, **{"world": "square-loop", "max_episode_steps": 6, **settings})
    inside: Any = env.unwrapped
    inside.agent, inside.recorder = "chance", EpisodeWriter(folder / name)
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    names = "actions", "rewards", "terminations", "truncations"
    was: dict[str, Any] = {"observations": [observation], **{each: [] for each in names}}
    over = False
    while not over:
        action = env.action_space.sample()
        observation, reward, terminated, truncated, _ = env.step(action)
        was["observations"].append(observation)
        for each, value in zip(names, (action, reward, terminated, truncated), strict=True):
            was[each].append(value)
        over = terminated or truncated
    was["spaces"] = env.observation_space, env.action_space
    env.close()
    return folder / name, was


@pytest.fixture
def record(tmp_path: Path) -> Callable[..., Recorded]:
    """Records an episode of chance in the test's folder."""
    return partial(record_episode, tmp_path)


def check_same(found: Any, was: dict[str, Any]) -> None:
    """Compare transitions, ours or Minari's, with what was recorded: to the last bit."""
    space, actions = was["spaces"]
    assert found.actions.dtype == actions.dtype
    assert np.array_equal(found.actions, was["actions"])
    for name in ("rewards", "terminations", "truncations"):
        assert np.array_equal(getattr(found, name), was[name])
    assert found.rewards.dtype == np.float64
    if isinstance(space, gymnasium.spaces.Dict):
        assert found.observations.keys() == space.spaces.keys()
        for part in space:
            seen = [each[part] for each in was["observations"]]
            assert np.array_equal(found.observations[part], seen)
            assert found.observations[part].dtype == space[part].dtype
    else:
        assert np.array_equal(found.observations, was["observations"])
        assert found.observations.dtype == space.dtype
