"""The files of a training run: their folder, and the log of its episodes."""

from __future__ import annotations

import io
import json
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import read_plan, save_plan
from albot_core.errors import InputError
from albot_core.files import write_text

_PACKAGES = (
    "albot-env", "gymnasium", "numba", "numpy", "pymunk", "sb3-contrib", "stable-baselines3",
    "torch",
)  # fmt: skip


FIGURES = ("is_success", "spl", "coverage", "distance_home")
"""What the log keeps of an episode's last info, where the task knows it."""
_COLUMNS = ("r", "l", "t", *FIGURES)
POINTS = 30
"""Points of the learning curve of the training's own episodes."""
Row = Sequence[float | int | None]
"""Return, steps, seconds since the training began, and the figures; None for unknown."""


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
        write_text(
            self.versions, json.dumps({"command": command, **machine_facts()}, indent=1) + "\n"
        )
        self.checkpoints.mkdir(exist_ok=True)
        save_plan(plan, self.plan)

    def resume(self, task: str | None, **changes: Any) -> TrainingPlan:
        """The plan of the run that is there, after what a killed process left is cleared away.

        Raises:
            InputError: The folder holds no run, or one for another task.
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


def machine_facts() -> dict[str, Any]:
    """The machine, and the versions of Python and of the packages, that a training runs on."""
    versions = {name: version(name) for name in _PACKAGES}
    machine = f"{platform.machine()}, {os.cpu_count()} processors"
    return {"python": platform.python_version(), "machine": machine, "versions": versions}


def free_folder(parent: Path, plan: TrainingPlan) -> Path:
    """The first folder of a training's name that does not exist: `runs/Homing-v0-ppo-1`."""
    name = f"{plan.task.rpartition('/')[2]}-{plan.algorithm}"
    number = 1
    while (parent / f"{name}-{number}").exists():
        number += 1
    return parent / f"{name}-{number}"


class EpisodeLog:
    """The episodes of a training, one a line, as stable-baselines3's `load_results` reads them.

    Lines are written whole or not at all.

    Args:
        path: The file, which is made if it does not exist.
        task: Id of the environment.
        size: Bytes of the file that count; what follows (of samples that no checkpoint holds)
            is cut off. 0 for a new file.

    Raises:
        InputError: The file cannot be written, or is shorter.
    """

    def __init__(self, path: Path, task: str, size: int = 0) -> None:
        self._path = path
        began = json.dumps({"t_start": time.time(), "env_id": task})
        header = f"#{began}\n{','.join(_COLUMNS)}\n"
        if not size:
            write_text(path, header)
            size = len(header.encode())
        self.size = size
        """Bytes of all episodes written so far."""
        self._write(b"")

    def add(self, rows: Sequence[Row]) -> None:
        """Write episodes down.

        Raises:
            InputError: There is no room left.
        """
        if rows:
            lines = "".join(f"{','.join(map(_cell, row))}\n" for row in rows).encode()
            self._write(lines)
            self.size += len(lines)

    @property
    def curve(self) -> dict[str, list[float]]:
        """The mean return of the episodes so far, in `POINTS` parts, and samples at their ends."""
        table = self._path.read_text().splitlines()[2:]
        if not table:
            return {}
        returns, steps = np.array([line.split(",")[:2] for line in table], float).T
        parts = np.array_split(np.arange(len(table)), min(POINTS, len(table)))
        return {
            "samples": [float(steps[: part[-1] + 1].sum()) for part in parts],
            "return": [float(returns[part].mean()) for part in parts],
        }

    def _write(self, lines: bytes) -> None:
        """Write lines after the bytes that count, in place of what follows; all of them or none."""
        try:
            with self._path.open("r+b", buffering=0) as stream:
                if stream.seek(0, 2) < self.size:
                    found = str(stream.tell())
                    raise InputError(self._path, f"{self.size} bytes or more", found)
                stream.truncate(self.size)
                stream.seek(self.size)
                try:
                    _write_all(stream, lines)
                except OSError:
                    stream.truncate(self.size)
                    raise
        except OSError as error:
            raise InputError(self._path, "room to write", error.strerror or str(error)) from None


def _write_all(stream: io.FileIO, content: bytes) -> None:
    """Write everything: a disk that is nearly full takes a part first, and then says so."""
    while content:
        content = content[stream.write(content) :]


def _cell(value: float | int | None) -> str:
    """A number as the log writes it: empty where it is unknown."""
    return "" if value is None else f"{value:.7g}"
