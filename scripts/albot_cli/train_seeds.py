"""Training with several seeds, for `albot train --seeds`: its progress and its results."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

import click

from albot_agents.engine.local import LocalEngine
from albot_cli.outputs import filled_folder
from albot_cli.progress import ProgressCallback, is_json, progress_board
from albot_core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from albot_agents.engine.engine import Engine
    from albot_agents.training.plan import TrainingPlan
    from albot_agents.training.run_files import RunFolder
    from albot_agents.training.seed_folder import SeedFolder, SeedRun


def train_with_seeds(
    folder: SeedFolder, runs: Mapping[int, SeedRun], engine: Engine, every: float
) -> dict[str, Any]:
    """Train all runs that have not come to their end; write the curve; return the outcome.

    Args:
        folder: The folder of the runs.
        runs: The runs by seed.
        engine: Where they are trained: in processes, or on a cluster.
        every: Time between two lines of a run without a terminal (s).

    Raises:
        InputError: A run failed; the others came to their end.
        RuntimeError: A run failed by a bug.
    """
    from albot_agents.training.seed_processes import train_seeds

    unfinished = {seed: run for seed, run in runs.items() if not run[0].is_finished(run[1])}
    with progress_board("samples", every=every) as begin:
        reporter = _Reporter(begin, {seed: plan.n_timesteps for seed, (_, plan) in runs.items()})
        if isinstance(engine, LocalEngine):
            errors, stopped = train_seeds(unfinished, engine.workers, reporter)
        else:
            from albot_agents.training.seed_tasks import train_on_cluster

            errors, stopped = train_on_cluster(unfinished, engine, reporter)
    result = _result(folder, runs, stopped)
    for error in errors.values():
        if not isinstance(error, InputError):
            raise error
    if errors:
        found = f"errors with seed {', '.join(map(str, errors))}, as told above"
        raise InputError(folder.path, "runs that come to their end", found)
    return result


class _Reporter:
    """Shows the progress of each run.

    Args:
        begin: Begins to show one.
        samples: Number of samples in all, by seed.
    """

    def __init__(
        self, begin: Callable[[str, int, int], ProgressCallback], samples: Mapping[int, int]
    ) -> None:
        self._begin, self._samples = begin, samples

    def begin(self, seed: int, samples: int) -> ProgressCallback:
        """Begin to show the progress of a seed."""
        return self._begin(f"seed {seed}", self._samples[seed], samples)

    def warn(self, text: str) -> None:
        """Print a warning."""
        click.echo(f"albot: {text}", err=True)

    def stop(self) -> None:
        """Tell that the runs are being stopped."""
        if not is_json():
            self.warn("each run stops after its update; Ctrl-C again stops all at once")


def _result(folder: SeedFolder, runs: Mapping[int, SeedRun], stopped: bool) -> dict[str, Any]:
    """Return the outcome by what the files say; write the learning curve if all have ended."""
    from albot_agents.training.learning_curve import FILES, read_curves

    plan = next(iter(runs.values()))[1]
    result: dict[str, Any] = {
        "task": plan.task,
        "algorithm": plan.algorithm,
        "folder": str(folder.path),
    }
    rows = [_row(seed, *run) for seed, run in runs.items()]
    result |= {"stopped": stopped, "runs": rows}
    curve: dict[str, Any] = {}
    files = {}
    if not stopped and any(row["figures"] for row in rows):
        curves = read_curves([folder.path])
        with filled_folder(folder.path) as scratch:
            curves.write(scratch)
        files = {name.rpartition(".")[2]: str(folder.path / name) for name in FILES}
        curve = {"seeds": list(curves.curves), **curves.last}
    return result | {"curve": curve, "files": files}


def _row(seed: int, run: RunFolder, plan: TrainingPlan) -> dict[str, Any]:
    """Return the outcome of a seed, by the agent of its last checkpoint if there is one."""
    from albot_agents.trained.agent_file import read_agent
    from albot_agents.training.learning_curve import FIGURES

    row: dict[str, Any] = {"seed": seed, "folder": str(run.path)}
    row |= {"samples": 0, "episodes": 0, "seconds": 0.0, "figures": {}}
    if run.last.exists():
        training = read_agent(run.last).training
        row |= {name: getattr(training, name) for name in ("samples", "episodes", "seconds")}
        ends = {name: training.curve.get(name) for name in FIGURES}
        row["figures"] = {name: values[-1] for name, values in ends.items() if values}
    agents = {"best": run.best, "last": run.last}
    files = {name: str(path) for name, path in agents.items() if path.exists()}
    return row | {"finished": run.is_finished(plan), "files": files}


def seeds_as_text(result: dict[str, Any]) -> str:
    """Return the outcome as text."""
    from albot_agents.training.learning_curve import FIGURES, seeds_text, spread_text

    seeds = [row["seed"] for row in result["runs"]]
    lines = [
        f"{result['task']} with {result['algorithm']}, {seeds_text(seeds)}"
        + (", stopped before the end" if result["stopped"] else "")
    ]
    for row in result["runs"]:
        known = [f"{FIGURES[name]} {value:.2f}" for name, value in row["figures"].items()]
        figures = ", ".join((f"{row['samples']:,} samples", *known))
        lines.append(f"  seed {row['seed']:<5} {figures}  {row['folder']}")
    if result["curve"]:
        curve = dict(result["curve"])
        spread = ", ".join(spread_text(name, curve[name]) for name in FIGURES if name in curve)
        lines.append(f"  mean (min to max) of {seeds_text(curve['seeds'])}: {spread}")
    lines += [f"  {name:<10} {path}" for name, path in result["files"].items()]
    if result["stopped"]:
        lines.append(f"  continue with: albot train --resume {shlex.quote(result['folder'])}")
    return "\n".join(lines)
