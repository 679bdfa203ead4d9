"""The folder of a training run."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.reading import read_plan, save_plan
from albot_core.errors import InputError
from albot_core.files import write_text

_PACKAGES = (
    "albot-env", "gymnasium", "numba", "numpy", "pymunk", "sb3-contrib", "stable-baselines3",
    "torch",
)  # fmt: skip


@dataclass(frozen=True)
class RunFolder:
    """Where everything lies that a run writes."""

    path: Path
    """The folder."""

    @property
    def plan(self) -> Path:
        """The plan as it is carried out; the seed stands in it."""
        return self.path / "config.yml"

    @property
    def versions(self) -> Path:
        """The versions of what it runs on, and the command."""
        return self.path / "versions.json"

    @property
    def monitor(self) -> Path:
        """The episodes, as stable-baselines3's `load_results` reads them."""
        return self.path / "monitor.csv"

    @property
    def tensorboard(self) -> Path:
        """The log for TensorBoard."""
        return self.path / "tensorboard"

    @property
    def evaluations(self) -> Path:
        """The evaluations, as stable-baselines3's `EvalCallback` writes them."""
        return self.path / "evaluations.npz"

    @property
    def checkpoints(self) -> Path:
        """The checkpoints."""
        return self.path / "checkpoints"

    @property
    def best(self) -> Path:
        """The agent that did best in an evaluation."""
        return self.path / "best.albot"

    @property
    def last(self) -> Path:
        """The agent of the last checkpoint."""
        return self.path / "last.albot"

    def begin(self, plan: TrainingPlan, command: str) -> None:
        """Make the folder of a new run.

        Raises:
            InputError: There is one already, or nothing can be written there.
        """
        if self.monitor.exists():
            expected = f"a folder without a run (or --resume {self.path})"
            raise InputError(self.path, expected, self.monitor.name)
        write_text(self.versions, json.dumps({"command": command, **facts()}, indent=1) + "\n")
        self.checkpoints.mkdir(exist_ok=True)
        save_plan(plan, self.plan)

    def resume(self, task: str | None, **changes: Any) -> TrainingPlan:
        """The plan of the run that is there, after what a killed process left is cleared away.

        Raises:
            InputError: There is none, or it is for another task.
        """
        if not self.plan.is_file():
            raise InputError(self.path, f"a training's folder with {self.plan.name}", "none")
        plan = read_plan(self.plan, task, **changes)
        for folder in (self.path, self.checkpoints):
            for left in folder.glob(".*.*.*"):
                left.unlink(missing_ok=True)
        save_plan(plan, self.plan)
        return plan

    @property
    def command(self) -> str:
        """The command that began the run."""
        told = (
            json.loads(self.versions.read_text(encoding="utf-8")) if self.versions.exists() else {}
        )
        return str(told.get("command", ""))


def facts() -> dict[str, Any]:
    """What a training runs on."""
    versions = {name: version(name) for name in _PACKAGES}
    machine = f"{platform.machine()}, {os.cpu_count()} processors"
    return {"python": platform.python_version(), "machine": machine, "versions": versions}


def free_folder(parent: Path, plan: TrainingPlan) -> Path:
    """A folder of a name that none has yet: `runs/Homing-v0-ppo-1`."""
    name = f"{plan.task.rpartition('/')[2]}-{plan.algorithm}"
    number = 1
    while (parent / f"{name}-{number}").exists():
        number += 1
    return parent / f"{name}-{number}"
