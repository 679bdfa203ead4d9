"""The files of a training run: the folder, and the log of episodes."""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_agents.trained.agent_file import read_agent
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import read_plan, save_plan
from albot_core.errors import InputError, MissingFileError
from albot_core.files import (
    make_folder,
    new_folder,
    read_bytes,
    sole_writer,
    write_all,
    write_text,
)
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_record

_PACKAGES = (
    "albot-env", "gymnasium", "numba", "numpy", "pymunk", "sb3-contrib", "stable-baselines3",
    "torch",
)  # fmt: skip
LAST_AGENT = "last.albot"
"""Name of the file of the last checkpoint's agent."""
FIGURES = ("is_success", "spl", "coverage", "distance_home")
"""Values of an episode's last info that the log keeps, if the task has them."""
_COLUMNS = ("r", "l", "t", *FIGURES)
POINTS = 30
"""Number of points of the learning curve over training episodes."""
_PATIENCE = 10.0
"""Longest time for which a run waits for another process to leave its folder (s): one whose parent
was killed ends a little later."""
Row = Sequence[float | int | None]
"""Return, steps, time since the training began (s), and the `FIGURES`; None if unknown."""


@dataclass(frozen=True)
class RunFolder:
    """The folder with all files of a run."""

    path: Path
    """The folder."""

    @property
    def plan(self) -> Path:
        """The plan of the run, including the seed."""
        return self.path / "config.yml"

    @property
    def versions(self) -> Path:
        """The versions of Python and packages, and the command."""
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
    def demonstrations(self) -> Path:
        """The demonstrations of the pretraining."""
        return self.path / "demonstrations.npz"

    @property
    def checkpoints(self) -> Path:
        """The checkpoints."""
        return self.path / "checkpoints"

    @property
    def best(self) -> Path:
        """The agent with the best evaluation."""
        return self.path / "best.albot"

    @property
    def last(self) -> Path:
        """The agent of the last checkpoint."""
        return self.path / LAST_AGENT

    def begin(self, plan: TrainingPlan, command: str) -> None:
        """Make the folder of a new run.

        Raises:
            InputError: The folder holds a run already, or cannot be written.
        """
        if self.monitor.exists():
            expected = f"a folder without a run (or --resume {self.path})"
            raise InputError(self.path, expected, self.monitor.name)
        facts = {"command": command, **machine_facts()}
        with new_folder(self.path):
            write_text(self.versions, json.dumps(facts, indent=1) + "\n")
            make_folder(self.checkpoints)
            save_plan(plan, self.plan)

    def resume(
        self, task: str | None, *, n_timesteps: int | None = None, tried: bool = True
    ) -> TrainingPlan:
        """Delete temporary files that a killed process left; return the plan of the existing run.

        Arguments and errors are those of `check`.
        """
        plan = self.check(task, n_timesteps=n_timesteps, tried=tried)
        make_folder(self.checkpoints)
        for folder in (self.path, self.checkpoints):
            for left in folder.glob(".*.*.*"):
                left.unlink(missing_ok=True)
        save_plan(plan, self.plan)
        return plan

    def check(
        self, task: str | None, *, n_timesteps: int | None = None, tried: bool = True
    ) -> TrainingPlan:
        """Check that the existing run can be resumed; return its plan.

        Args:
            task: The task; None for the run's.
            n_timesteps: Samples in all, which replace the plan's; None to keep these.
            tried: As for `read_plan`.

        Raises:
            InputError: The folder holds no run, or one for another task, or one with more samples
                than `n_timesteps`, or its checkpoints are damaged or gone.
        """
        from albot_agents.training.checkpoint import checkpoints  # Slow to load: PyTorch.

        if not self.plan.is_file():
            raise InputError(
                self.path, f"the folder of a training run, with {self.plan.name}", "none"
            )
        begun = bool(checkpoints(self.checkpoints))
        plan = read_plan(
            self.plan, task, tried=tried, saved=True, pretrained=begun, n_timesteps=n_timesteps
        )
        # Without a checkpoint a run begins anew, as one that was stopped before its first. But an
        # agent is saved only with a checkpoint.
        if self.last.exists() and not checkpoints(self.checkpoints):
            expected = f"the checkpoint of {self.last.name}"
            raise InputError(self.checkpoints, expected, "none; a new run needs a new folder")
        if n_timesteps is not None:
            self._check_unreached(n_timesteps)
        return plan

    def _check_unreached(self, n_timesteps: int) -> None:
        """Raise InputError if the run has more samples than `n_timesteps` already."""
        from albot_agents.training.checkpoint import newest_checkpoint  # Slow to load: PyTorch.

        found = newest_checkpoint(self.checkpoints)
        done = 0 if found is None else found[1].samples
        if n_timesteps < done:
            expected = f"at least the {done:,} samples that are done, as the samples in all"
            raise InputError(self.path, expected, f"{n_timesteps:,}", place="--steps")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Let no other process train in the folder during the block.

        Raises:
            InputError: One does, and goes on for `_PATIENCE`.
        """
        if not self.versions.is_file():
            yield
            return
        with sole_writer(self.versions, self.path, _PATIENCE):
            yield

    @property
    def curve(self) -> dict[str, list[float]]:
        """The learning curve up to the last checkpoint; empty if there is none.

        Raises:
            InputError: The agent of the last checkpoint is damaged.
        """
        return dict(read_agent(self.last).training.curve) if self.last.exists() else {}

    def is_finished(self, plan: TrainingPlan) -> bool:
        """Return whether the run has all samples of its plan, and the evaluation after the last."""
        try:
            training = read_agent(self.last).training
        except InputError:  # There is none yet, or it is damaged; the run then writes it.
            return False
        if training.samples < plan.n_timesteps:
            return False
        measured = training.curve.get("samples") or [0.0]
        return plan.evaluation is None or measured[-1] >= training.samples

    @property
    def command(self) -> str:
        """The command that started the run; empty if the file `versions` is missing.

        Raises:
            InputError: That file is damaged.
        """
        if not self.versions.exists():
            return ""
        facts = read_json(self.versions)
        command: str = read_record({"command": str}, facts, Location(self.versions), others=True)[
            "command"
        ]
        return command


def machine_facts() -> dict[str, Any]:
    """Return the machine, and the versions of Python and packages, of a training run."""
    versions = {name: version(name) for name in _PACKAGES}
    machine = f"{platform.machine()}, {os.cpu_count()} processors"
    return {"python": platform.python_version(), "machine": machine, "versions": versions}


def free_folder(parent: Path, plan: TrainingPlan) -> Path:
    """Return the first folder name that is not in use, such as `runs/Homing-v0-ppo-1`."""
    name = f"{plan.task.rpartition('/')[2]}-{plan.algorithm}"
    number = 1
    while (parent / f"{name}-{number}").exists():
        number += 1
    return parent / f"{name}-{number}"


class EpisodeLog:
    """A log with one line per episode, which stable-baselines3's `load_results` can read.

    Lines are written atomically.

    Args:
        path: The file; it is created if it does not exist.
        task: Id of the environment.
        size: Size of the valid part (bytes); the rest, of samples that no checkpoint holds, is
            cut off. 0 for a new file.

    Raises:
        InputError: The file cannot be written, is shorter than `size`, or is damaged.
    """

    def __init__(self, path: Path, task: str, size: int = 0) -> None:
        self._path = path
        began = json.dumps({"t_start": time.time(), "env_id": task})
        header = f"#{began}\n{','.join(_COLUMNS)}\n"
        if not size:
            write_text(path, header)
            size = len(header.encode())
        self.size = size
        """Size of the valid part of the file (bytes)."""
        self._write(b"")
        self._episodes()  # Raise for a damaged file now, not at the next checkpoint.

    def add(self, rows: Sequence[Row]) -> None:
        """Append episodes to the log.

        Raises:
            InputError: The disk is full.
        """
        if rows:
            lines = "".join(f"{','.join(map(_cell, row))}\n" for row in rows).encode()
            self._write(lines)
            self.size += len(lines)

    @property
    def curve(self) -> dict[str, list[float]]:
        """Learning curve of the episodes so far: `samples`, and mean `return` of each part."""
        returns, steps = self._episodes()
        if not len(steps):
            return {}
        parts = np.array_split(np.arange(len(steps)), min(POINTS, len(steps)))
        return {
            "samples": [float(steps[: part[-1] + 1].sum()) for part in parts],
            "return": [float(returns[part].mean()) for part in parts],
        }

    def _episodes(self) -> Float64[np.ndarray, "2 episodes"]:
        """Return the returns and the step counts of the episodes so far."""
        table = read_bytes(self._path)[: self.size].splitlines()[2:]
        try:
            rows = np.array([line.split(b",")[:2] for line in table], np.float64).reshape(-1, 2)
        except ValueError as error:
            expected = f"a line {','.join(_COLUMNS)} for each episode"
            raise InputError(self._path, expected, str(error)) from None
        if not np.isfinite(rows).all():
            raise InputError(self._path, "finite numbers", "NaN or infinity")
        return rows.T

    def _write(self, lines: bytes) -> None:
        """Replace everything after the valid part by lines, all of them or none."""
        try:
            with self._path.open("r+b", buffering=0) as stream:
                if stream.seek(0, 2) < self.size:
                    found = str(stream.tell())
                    raise InputError(self._path, f"{self.size} bytes or more", found)
                stream.truncate(self.size)
                stream.seek(self.size)
                try:
                    write_all(stream, lines)
                except OSError:
                    stream.truncate(self.size)
                    raise
        except FileNotFoundError:
            raise MissingFileError(self._path) from None
        except OSError as error:
            raise InputError(self._path, "free disk space", error.strerror or str(error)) from None


def _cell(value: float | int | None) -> str:
    """Return a number as text for the log; empty if unknown."""
    return "" if value is None else f"{value:.7g}"
