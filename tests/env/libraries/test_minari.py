"""Minari: data sets of episodes, and the environment that it makes again from one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from tests.env.libraries.conftest import EXPLORE

pytest.importorskip("minari", reason="minari is not installed: pip install '.[compat]'")
pytest.importorskip("h5py", reason="h5py is not installed: pip install '.[compat]'")

import minari
from minari.data_collector import EpisodeBuffer

CONFIG = ExploreConfig(observations=ObservationConfig(laser_sectors=12), claims=False)
ABOUT: dict[str, Any] = {
    "dataset_id": "albot/explore/test-v0",
    "algorithm_name": "by chance",
    "author": "somebody",
    "author_email": "somebody@example.org",
    "code_permalink": "https://example.org",
    "description": "Two short episodes.",
}


@pytest.fixture
def env(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[gymnasium.Env[Any, Any]]:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = gymnasium.make("Albot/Explore-v0", config=CONFIG, **EXPLORE)
    yield env
    env.close()


def _check(dataset: Any, episodes: int) -> None:
    """Compare a data set with what the environment gives that is made again from it."""
    assert dataset.total_episodes == episodes
    again = dataset.recover_environment()
    assert again.observation_space == dataset.observation_space
    for number, episode in enumerate(dataset.iterate_episodes()):
        observation, _ = again.reset(seed=number)
        seen = [observation, *(again.step(action)[0] for action in episode.actions)]
        np.testing.assert_array_equal(seen, episode.observations)
        assert episode.truncations[-1]


def test_an_environment_is_made_again_from_a_data_set(env: gymnasium.Env[Any, Any]) -> None:
    buffers = []
    for seed in range(2):
        observations, _ = env.reset(seed=seed)
        kept: dict[str, list[Any]] = {name: [] for name in ("actions", "rewards", "truncations")}
        kept["observations"] = [observations]
        while not (kept["truncations"] and kept["truncations"][-1]):
            action = env.action_space.sample()
            observation, reward, _, truncated, _ = env.step(action)
            values = action, reward, truncated, observation
            for name, value in zip(kept, values, strict=True):
                kept[name].append(value)
        over = [False] * len(kept["rewards"])
        arrays = {name: np.array(kept[name]) for name in ("actions", "observations")}
        lists = {name: kept[name] for name in ("rewards", "truncations")}
        buffers.append(EpisodeBuffer(id=seed, seed=seed, terminations=over, **arrays, **lists))
    dataset = minari.create_dataset_from_buffers(buffer=buffers, env=env, eval_env=env, **ABOUT)
    _check(dataset, 2)


def test_its_collector(env: gymnasium.Env[Any, Any]) -> None:
    pytest.importorskip("jax", reason="minari collects with jax: pip install '.[compat]'")
    collector = minari.DataCollector(env)
    for seed in range(2):
        collector.reset(seed=seed)
        over = False
        while not over:
            *_, terminated, truncated, _ = collector.step(collector.action_space.sample())
            over = terminated or truncated
    _check(collector.create_dataset(eval_env=env, **ABOUT), 2)
