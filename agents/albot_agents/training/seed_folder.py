"""The folder of several runs that differ only in their seeds."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from albot_agents.evaluation.plan import MOST_SEEDS, parse_seeds
from albot_agents.training.learning_curve import SEED_FOLDERS
from albot_agents.training.plan import LARGEST_SEED, TrainingPlan
from albot_agents.training.plan_file import read_plan, save_plan
from albot_agents.training.run_files import RunFolder
from albot_core.errors import InputError
from albot_core.files import new_folder, sole_writer, write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_record

SeedRun = tuple[RunFolder, TrainingPlan]
"""The folder of a seed's run, after `RunFolder.begin` or `RunFolder.resume`, and its plan."""


@dataclass(frozen=True)
class SeedFolder:
    """The folder with the runs of all seeds, each in a folder of its own."""

    path: Path
    """The folder."""

    @property
    def seeds(self) -> Path:
        """The file that names the seeds, and the command."""
        return self.path / "seeds.json"

    @property
    def plan(self) -> Path:
        """The plan of all runs, with the first seed."""
        return self.path / "config.yml"

    def run(self, seed: int) -> RunFolder:
        """Return the folder of a seed's run."""
        return RunFolder(self.path / f"{SEED_FOLDERS}{seed}")

    def begin(self, plan: TrainingPlan, seeds: Sequence[int], command: str) -> dict[int, SeedRun]:
        """Make the folders of new runs; return the run of each seed.

        Raises:
            InputError: The folder holds runs already, or cannot be written.
        """
        for file in (self.seeds, RunFolder(self.path).monitor):
            if file.exists():
                expected = f"a folder without runs (or --resume {self.path})"
                raise InputError(self.path, expected, file.name)
        with new_folder(self.path):
            save_plan(dataclasses.replace(plan, seed=seeds[0]), self.plan)
            # From here on, the folder counts as that of these seeds.
            content = {"seeds": list(seeds), "command": command}
            write_text(self.seeds, json.dumps(content) + "\n")
            return {seed: self._begin(seed, plan, command) for seed in seeds}

    def resume(self, task: str | None, *, n_timesteps: int | None = None) -> dict[int, SeedRun]:
        """Return the run of each seed, after making those that never began.

        Args:
            task: The task; None for the runs'.
            n_timesteps: Samples of each run, which replace the plans'; None to keep these.

        Raises:
            InputError: The files of the folder are damaged, or a run cannot be resumed as by
                `RunFolder.check`; nothing has been changed.
        """
        kinds = {"seeds": list[int], "command": str}
        found = read_record(kinds, read_json(self.seeds), Location(self.seeds))
        check_seeds(found["seeds"], self.seeds)
        from albot_agents.training.checkpoint import checkpoints  # Slow to load: PyTorch.

        pretrained = all(checkpoints(self.run(seed).checkpoints) for seed in found["seeds"])
        plan = read_plan(
            self.plan, task, saved=True, pretrained=pretrained, n_timesteps=n_timesteps
        )
        begun = {seed for seed in found["seeds"] if self.run(seed).plan.is_file()}
        for seed in begun:
            self.run(seed).check(task, n_timesteps=n_timesteps, tried=False)
        save_plan(plan, self.plan)
        runs = {}
        for seed in found["seeds"]:
            run = self.run(seed)
            if seed in begun:
                runs[seed] = run, run.resume(task, n_timesteps=n_timesteps, tried=False)
            else:
                runs[seed] = self._begin(seed, plan, found["command"])
        return runs

    def locked(self) -> AbstractContextManager[None]:
        """Let no other process train with the seeds of the folder during the block.

        Raises:
            InputError: One does.
        """
        return sole_writer(self.seeds, self.path)

    def _begin(self, seed: int, plan: TrainingPlan, command: str) -> SeedRun:
        run, its = self.run(seed), dataclasses.replace(plan, seed=seed)
        run.begin(its, command)
        return run, its


def parse_seed_list(text: str, option: str = "--seeds") -> tuple[int, ...]:
    """Parse the seeds of several runs: `A..B`, both included, one number, or a list of these.

    Args:
        text: The text.
        option: The option that it was given to, for the error.

    Raises:
        InputError: It is something else, or `check_seeds` raises it.
    """
    seeds: list[int] = []
    for part in text.split(","):
        try:
            found = parse_seeds(part, option)
        except InputError as error:
            expected = f"{error.expected}, or a list of these with commas"
            raise InputError(option, expected, text or "nothing") from None
        seeds += found[: MOST_SEEDS - len(seeds) + 1]
    check_seeds(seeds, option)
    return tuple(seeds)


def check_seeds(seeds: Sequence[int], source: object) -> None:
    """Check the seeds of several runs.

    Raises:
        InputError: There are none, or more than `MOST_SEEDS`, or one is not from 0 to
            `LARGEST_SEED` or is named twice.
    """
    if not 1 <= len(seeds) <= MOST_SEEDS:
        found = f"{'more' if seeds else 'none'}"
        raise InputError(source, f"1 to {MOST_SEEDS:,} seeds", found)
    wrong = next((seed for seed in seeds if not 0 <= seed <= LARGEST_SEED), None)
    if wrong is not None:
        raise InputError(source, f"seeds from 0 to {LARGEST_SEED}", str(wrong))
    known: set[int] = set()
    for seed in seeds:
        if seed in known:
            raise InputError(source, "each seed once", f"{seed} twice")
        known.add(seed)
