"""Trainings that are over in a second or two."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import read_plan
from albot_agents.training.run_files import RunFolder
from albot_core.files import write_text
from albot_core.plain_data import deep_merge

TASK = "Albot/Homing-v0"
SMALL: dict[str, Any] = {
    "n_envs": 2,
    "n_epochs": 1,
    "torch_threads": 1,
    "policy": {"net_arch": [8]},
    "env": {"world": "square-loop", "mapper": "none", "journeys": 1},
    "evaluation": None,
}
"""What trainings of all tasks have in common."""
TINY = deep_merge(
    SMALL,
    {
        "task": TASK,
        "n_timesteps": 64,
        "n_steps": 8,
        "batch_size": 16,
        "checkpoint_every": 32,
        "policy": {"initial_action": [0.5, 0, -1]},
        "env": {
            "max_episode_steps": 12,
            "config": {"outing": {"shortest": 1, "longest": 2, "away": 0}},
        },
        "evaluation": {"worlds": ["square-loop"], "seeds": "900", "every": 32},
    },
)
"""Four updates, one episode in an evaluation."""

SAMPLES = 160
"""Samples of a tiny run off-policy: two rounds of 32 steps of two environments, and a half."""


def off_policy(algorithm: str) -> dict[str, Any]:
    """A tiny plan for an algorithm that learns from a replay buffer."""
    plan = deep_merge(
        TINY,
        {
            "algorithm": algorithm,
            "n_timesteps": SAMPLES,
            "n_steps": 32,
            "n_epochs": 4,
            "batch_size": 8,
            "checkpoint_every": 64,
            "evaluation": {"every": 64},
            "policy": {"initial_action": [0.5, 0, -0.9]},
            "off_policy": {"buffer_size": 100, "learning_starts": 20, "gradient_steps": 1},
        },
    )
    if algorithm == "sac":
        return plan
    discrete = {"env": {"action": "discrete"}, "policy": {"initial_action": None}}
    return deep_merge(plan, discrete | {"off_policy": {"target_update_interval": 10}})


def plan_file(path: Path, plan: dict[str, Any] = TINY, **changes: Any) -> Path:
    """The tiny plan, or another one, as a YAML file, with changes."""
    import yaml

    write_text(path, yaml.safe_dump(deep_merge(plan, changes)))
    return path


def begun(
    folder: Path, plan: dict[str, Any] = TINY, **changes: Any
) -> tuple[RunFolder, TrainingPlan]:
    """The folder of a run that is about to begin, and its plan."""
    read = read_plan(plan_file(folder / "plan.yml", plan, **changes))
    run = RunFolder(folder / "run")
    run.begin(read, "albot train --config plan.yml")
    return run, read
