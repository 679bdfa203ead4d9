"""Data sets of evaluations: the same from single runs, from batches and from recorded episodes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.together import run_together
from albot_agents.evaluation.trial import run_trial
from albot_agents.registry import find_agent, make_agent
from albot_env.export.replay import replay
from albot_env.export.transitions import Transitions
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig


def _trials(task: str, agent: str, **settings: Any) -> list[Trial]:
    made = find_agent(agent).environment(task, {"odometer": "poor", **settings})
    return [
        Trial(task=task, agent=agent, world=world, seed=seed, settings=made, keeps_transitions=True)
        for seed, world in enumerate(("square-loop", "office-ring"), 3)
    ]


def _recorded(trial: Trial, path: Path) -> Transitions:
    """Record the trial as a user would, and replay it."""
    env = gymnasium.make(trial.task, world=trial.world, **trial.settings)
    inside: Any = env.unwrapped
    inside.spec, inside.agent = env.spec, trial.agent
    inside.recorder = EpisodeWriter(path)
    agent = make_agent(trial.agent, EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, trial.seed)
    over = False
    while not over:
        action = choose_action(agent, observation, info)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    env.close()
    return replay(EpisodeReader(path), path.name)


@pytest.mark.parametrize(
    ("task", "agent", "settings"),
    [
        ("Albot/Explore-v0", "exploring", {"max_episode_steps": 12}),
        (
            "Albot/ExploreAndHome-v1",
            "random",
            {"config": ExploreAndHomeConfig(shortest=5.0, longest=9.0), "observation": "dict"},
        ),
        ("Albot/Explore-v0", "gap-explorer", {"max_episode_steps": 5, "action": "discrete"}),
    ],
)
def test_alone_in_a_batch_and_recorded(
    task: str, agent: str, settings: dict[str, Any], tmp_path: Path
) -> None:
    trials = _trials(task, agent, **settings)
    together = run_together(trials)
    for trial, outcome in zip(trials, together, strict=True):
        alone = run_trial(trial).transitions
        recorded = _recorded(trial, tmp_path / f"{trial.seed}.mcap")
        batched = outcome.transitions
        assert alone is not None
        assert batched is not None
        assert len(alone.rewards) == len(alone.actions) == len(outcome.path) - 1
        for other in (batched, recorded):
            assert _bytes(other) == _bytes(alone)
            assert (other.seed, other.agent) == (trial.seed, agent)
            assert other.spec == alone.spec
        assert alone.spec["kwargs"]["world"] == trial.world


def _bytes(episode: Transitions) -> dict[str, Any]:
    seen = episode.observations
    parts = seen if isinstance(seen, dict) else {"all": seen}
    arrays = {name: getattr(episode, name) for name in ("actions", "rewards")}
    arrays |= {"terminations": episode.terminations, "truncations": episode.truncations, **parts}
    return {name: (array.dtype, array.shape, array.tobytes()) for name, array in arrays.items()}


def test_nothing_is_kept_unasked() -> None:
    (trial, _) = _trials("Albot/Explore-v0", "random", max_episode_steps=3)
    assert run_trial(replace(trial, keeps_transitions=False)).transitions is None
    kept = run_trial(trial).transitions
    assert kept is not None
    assert np.isfinite(kept.rewards).all()
