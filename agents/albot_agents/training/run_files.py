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
from jaxtyping import Float64

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import read_plan, save_plan
from albot_core.errors import InputError
from albot_core.files import make_folder, read_bytes, write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_record

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
        make_folder(self.path)
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
        """The command that began the run; empty where the file of versions is gone.

        Raises:
            InputError: That file is damaged.
        """
        if not self.versions.exists():
            return ""
        told = read_json(self.versions)
        command: str = read_record({"command": str}, told, Location(self.versions), others=True)[
            "command"
        ]
        return command


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
        InputError: The file cannot be written, is shorter, or is damaged.
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
        self._episodes()  # A damaged file is told now, not at the next checkpoint.

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
        returns, steps = self._episodes()
        if not len(steps):
            return {}
        parts = np.array_split(np.arange(len(steps)), min(POINTS, len(steps)))
        return {
            "samples": [float(steps[: part[-1] + 1].sum()) for part in parts],
            "return": [float(returns[part].mean()) for part in parts],
        }

    def _episodes(self) -> Float64[np.ndarray, "2 episodes"]:
        """The return and the steps of each episode so far."""
        table = read_bytes(self._path)[: self.size].splitlines()[2:]
        try:
            rows = np.array([line.split(b",")[:2] for line in table], np.float64).reshape(-1, 2)
        except ValueError as error:
            expected = f"a line {','.join(_COLUMNS)} for each episode"
            raise InputError(self._path, expected, str(error)) from None
        if not np.isfinite(rows).all():
            raise InputError(self._path, "finite numbers", "others")
        return rows.T

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
