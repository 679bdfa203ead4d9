"""The folder of a sweep: a training run for each trial, and what the trials are."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import read_plan, save_plan, try_plan
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_folder import SeedRun
from albot_core.errors import InputError
from albot_core.files import new_folder, sole_writer, write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, deep_merge, read_config, read_record, to_plain
from albot_core.yaml_document import dotted, format_value

TRIAL_FOLDERS = "trial-"
"""Beginning of the names of the runs' folders."""


@dataclass
class SweepFolder:
    """The folder with the runs of all trials, each in a folder of its own."""

    path: Path
    """The folder."""
    values: Sequence[Mapping[str, Any]] = ()
    """The values of each trial, by the name of the field, after `begin` or `resume`."""
    command: str = ""
    """The command that began it."""
    ended: Sequence[int] = ()
    """The trials that the scheduler has ended before their last sample."""

    @property
    def trials(self) -> Path:
        """The file that names the values of each trial, those that were ended, and the command."""
        return self.path / "sweep.json"

    @property
    def plan(self) -> Path:
        """The plan, with the search."""
        return self.path / "config.yml"

    @property
    def tune(self) -> Path:
        """Ray Tune's own files, while it runs; nothing is read from them."""
        return self.path / "tune"

    def run(self, trial: int) -> RunFolder:
        """Return the folder of a trial's run; trials are counted from 0."""
        width = len(str(max(0, len(self.values) - 1)))
        return RunFolder(self.path / f"{TRIAL_FOLDERS}{trial:0{width}}")

    def begin(self, plan: TrainingPlan, command: str, source: Path) -> dict[int, SeedRun]:
        """Make the folders of new runs; return the run of each trial.

        Args:
            plan: The plan.
            command: The command that begins it.
            source: The file of the plan, for errors.

        Raises:
            InputError: The folder holds runs already, or cannot be written, or the values of a
                trial do not fit the plan.
        """
        assert plan.sweep is not None
        for file in (self.trials, RunFolder(self.path).monitor):
            if file.exists():
                expected = f"a folder without runs (or --resume {self.path})"
                raise InputError(self.path, expected, file.name)
        self.values, self.command = plan.sweep.draw(plan.seed), command
        plans = [
            trial_plan(plan, number, values, source) for number, values in enumerate(self.values)
        ]
        with new_folder(self.path):
            save_plan(plan, self.plan)
            self._write()
            return {number: self._begin(number, its) for number, its in enumerate(plans)}

    def resume(self, task: str | None) -> tuple[TrainingPlan, dict[int, SeedRun]]:
        """Return the plan, and the run of each trial, after making those that never began.

        Args:
            task: The task; None for the sweep's.

        Raises:
            InputError: The files of the folder are damaged, or a run cannot be resumed as by
                `RunFolder.check`; nothing has been changed.
        """
        kinds = {"trials": list[dict[str, Any]], "ended": list[int], "command": str}
        where = Location(self.trials)
        found = read_record(kinds, read_json(self.trials), where)
        if not found["trials"]:
            raise where.at("trials").error("the values of one trial or more", "none")
        for place, number in enumerate(found["ended"]):
            if not 0 <= number < len(found["trials"]):
                expected = f"a trial from 0 to {len(found['trials']) - 1}"
                raise where.at("ended", place).error(expected, str(number))
        plan = read_plan(self.plan, task, saved=True, pretrained=True)
        if plan.sweep is None:
            raise InputError(self.plan, "the search of this folder", "none", place="sweep")
        self.values, self.ended = found["trials"], found["ended"]
        self.command = found["command"]
        begun = {k for k in range(len(self.values)) if self.run(k).plan.is_file()}
        for number in begun:
            self.run(number).check(task, tried=False)
        new = {
            number: trial_plan(plan, number, values, self.plan)
            for number, values in enumerate(self.values)
            if number not in begun
        }
        runs = {}
        for number in range(len(self.values)):
            run = self.run(number)
            if number in begun:
                runs[number] = run, run.resume(task, tried=False)
            else:
                runs[number] = self._begin(number, new[number])
        return plan, runs

    def locked(self) -> AbstractContextManager[None]:
        """Let no other process run the sweep of the folder during the block.

        Raises:
            InputError: One does.
        """
        return sole_writer(self.plan, self.path)

    def end(self, trial: int) -> None:
        """Note that the scheduler has ended a trial.

        Raises:
            InputError: The file cannot be written.
        """
        self.ended = sorted({*self.ended, trial})
        self._write()

    def curve(self, trial: int) -> dict[str, list[float]]:
        """Return the evaluations of a trial up to its last checkpoint; empty if there are none."""
        return self.run(trial).curve

    def best(self, metric: str) -> tuple[int, float] | None:
        """Return the best trial by its best evaluation, and that; None if nothing is measured."""
        scores = [
            (max(self.curve(number).get(metric) or [-math.inf]), -number)
            for number in range(len(self.values))
        ]
        score, number = max(scores)
        return None if score == -math.inf else (-number, score)

    def _begin(self, number: int, plan: TrainingPlan) -> SeedRun:
        run = self.run(number)
        run.begin(plan, self.command)
        return run, plan

    def _write(self) -> None:
        content = {"trials": to_plain(self.values), "ended": to_plain(self.ended)}
        write_text(self.trials, json.dumps(content | {"command": self.command}) + "\n")


def trial_plan(
    plan: TrainingPlan, number: int, values: Mapping[str, Any], source: Path
) -> TrainingPlan:
    """Return the plan of a trial.

    Args:
        plan: The plan of the sweep.
        number: Number of the trial, for errors.
        values: The values of the trial, by the name of the field.
        source: The file of the plan of the sweep, for errors.

    Raises:
        InputError: There is no such field, or its value does not fit.
    """
    assert plan.evaluation is not None
    told = ", ".join(f"{name} {format_value(value)}" for name, value in values.items())
    told = f"sweep, trial {number} with {told}"
    where = Location(source, place=lambda path: ", ".join(filter(None, (told, dotted(path)))))
    # With each evaluation comes a checkpoint, so that none is forgotten by a kill.
    every = min(plan.checkpoint_every, plan.evaluation.every)
    data = to_plain(dataclasses.replace(plan, sweep=None, checkpoint_every=every))
    for name, value in values.items():
        nested: Any = to_plain(value)
        for key in reversed(name.split(".")):
            nested = {key: nested}
        data = deep_merge(data, nested)
    found = read_config(TrainingPlan, data, where)
    with where.relocate_errors():
        found.check_unused_fields()
    try_plan(found, where)
    return found
