"""The learner's benchmark, in a hurry. No test of speed."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from albot_benchmarks import learner
from albot_benchmarks.learner import measure_learner
from albot_benchmarks.timed_batch import FreeBatch, TimedBatch
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.vector import TRAINING_EXTRA
from albot_env.vector.sb3 import make_batch


def test_every_run_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learner, "WORLD", "square-loop")
    figures = measure_learner(num_envs=4, steps=2, rollouts=1)
    runs = [(run["id"], run["mapper"], run["policy"]) for run in figures["runs"]]
    explore = "Albot/Explore-v0"
    assert runs == [
        ("free", None, "mlp"), (explore, "none", "mlp"), (explore, "albot1", "mlp"),
        ("free", None, "cnn"), (explore, "albot1", "mlp"), (explore, "albot1", "cnn"),
        (explore, "albot1", "planner"),
    ]  # fmt: skip
    assert [("map_patch" in run["parts"]) for run in figures["runs"]] == [False] * 3 + [True] * 4
    assert all(run["samples_per_second"] > 0 for run in figures["runs"])
    assert all(0 < run["environment_share"] < 1 for run in figures["runs"])
    assert (figures["num_envs"], figures["batch"], figures["epochs"]) == (4, 4096, 4)
    assert figures["runs"][0]["observation"] == ObservationConfig().flat_space.shape[0]


def test_without_the_learner_the_part_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    missing = f"torch and stable_baselines3; {TRAINING_EXTRA}"
    assert measure_learner() == {"missing": missing}


def test_a_free_batch_has_the_spaces_and_always_says_the_same() -> None:
    batch = make_batch("Albot/Explore-v0", 2, world="square-loop", mapper="none")
    timed = TimedBatch(FreeBatch(batch))
    assert timed.observation_space == batch.observation_space
    first = timed.reset()
    for _ in range(3):
        observations, rewards, over, infos = timed.step(np.ones((2, 3), np.float32))
        assert observations is first
        assert (rewards.tolist(), over.tolist(), infos) == ([0, 0], [False, False], [{}, {}])
    assert timed.seconds > 0


def test_a_timed_batch_steps_as_the_batch_does() -> None:
    settings = {"world": "square-loop", "mapper": "none"}
    plain = make_batch("Albot/Explore-v0", 2, **settings)
    timed = TimedBatch(make_batch("Albot/Explore-v0", 2, **settings))
    plain.seed(1), timed.seed(1)
    assert np.array_equal(plain.reset(), timed.reset())
    actions = np.ones((2, 3), np.float32)
    assert np.array_equal(plain.step(actions)[0], timed.step(actions)[0])
