"""A sweep of `albot train`: its progress and its results."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

import click

from albot_cli.progress import ProgressCallback, progress
from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_core.yaml_document import format_value

if TYPE_CHECKING:
    from collections.abc import Mapping

    from albot_agents.engine.engine import Engine
    from albot_agents.training.plan import TrainingPlan
    from albot_agents.training.seed_folder import SeedRun
    from albot_agents.training.sweep_folder import SweepFolder


def train_sweep(
    folder: SweepFolder,
    plan: TrainingPlan,
    runs: Mapping[int, SeedRun],
    engine: Engine,
    every: float,
) -> dict[str, Any]:
    """Run all trials that have not come to their end; return the outcome.

    Args:
        folder: The folder of the sweep.
        plan: Its plan.
        runs: The run of each trial.
        engine: The cluster.
        every: Time between two lines of progress without a terminal (s).

    Raises:
        InputError: A trial failed; the others came to their end.
    """
    from albot_agents.training.sweep import run_sweep

    total = plan.n_timesteps * len(runs)
    title = f"sweep of {len(runs)} trials, {plan.task}"
    with progress(title, total, "samples", every=every) as update:
        errors, stopped = run_sweep(folder, plan, runs, engine, _Reporter(update))
    if errors:
        found = f"errors in trial {', '.join(map(str, sorted(errors)))}, as told above"
        raise InputError(folder.path, "trials that come to their end", found)
    return _result(folder, plan, runs, stopped)


class _Reporter:
    """Shows the progress of all trials together."""

    def __init__(self, update: ProgressCallback) -> None:
        self._update = update

    def progress(self, samples: int, note: str) -> None:
        """Show the number of samples so far."""
        self._update(samples, note)

    def warn(self, text: str) -> None:
        """Print a warning."""
        click.echo(f"albot: {text}", err=True)


def _result(
    folder: SweepFolder, plan: TrainingPlan, runs: Mapping[int, SeedRun], stopped: bool
) -> dict[str, Any]:
    """Return the outcome by what the files say."""
    assert plan.sweep is not None
    rows = []
    for number, (run, _) in runs.items():
        curve = folder.curve(number)
        scores = curve.get(plan.sweep.metric, [])
        row = {"trial": number, "folder": str(run.path), "values": dict(folder.values[number])}
        row |= {"samples": int((curve.get("samples") or [0])[-1])}
        row |= {"best": max(scores, default=None), "last": scores[-1] if scores else None}
        rows.append(row | {"ended_early": number in folder.ended})
    best = folder.best(plan.sweep.metric)
    return {
        "task": plan.task,
        "algorithm": plan.algorithm,
        "folder": str(folder.path),
        "metric": plan.sweep.metric,
        "stopped": stopped,
        "trials": to_plain(rows),
        "best": None
        if best is None
        else {"trial": best[0], "score": best[1], "agent": str(runs[best[0]][0].best)},
    }


def sweep_as_text(result: dict[str, Any]) -> str:
    """Return the outcome as text, the best trial first."""
    metric = result["metric"]
    lines = [
        f"{result['task']} with {result['algorithm']}, {len(result['trials'])} trials"
        + (", stopped before the end" if result["stopped"] else "")
    ]
    for row in sorted(result["trials"], key=_by_score):
        values = ", ".join(f"{name} {format_value(each)}" for name, each in row["values"].items())
        score = "not measured" if row["best"] is None else f"{metric} {row['best']:.3f}"
        early = ", ended early" if row["ended_early"] else ""
        lines.append(f"  trial {row['trial']:<4} {score}, {row['samples']:,} samples{early}")
        lines.append(f"    {values}  {row['folder']}")
    if result["best"] is not None:
        best = result["best"]
        lines.append(
            f"  best: trial {best['trial']}, {metric} {best['score']:.3f}, {best['agent']}"
        )
    if result["stopped"]:
        folder = shlex.quote(result["folder"])
        lines.append(f"  continue with: albot train --resume {folder} --engine ray")
    return "\n".join(lines)


def _by_score(row: dict[str, Any]) -> tuple[float, int]:
    score = row["best"]
    return (float("inf") if score is None else -score, row["trial"])
