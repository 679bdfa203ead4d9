"""The learning curve of runs that differ only in their seeds, with its spread."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_agents.trained.agent_file import read_agent
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import read_plan
from albot_agents.training.run_files import RunFolder
from albot_core.counts import many
from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import SERIES
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_core.plain_data import differences, to_plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES = {"success_rate": "success", "spl": "SPL", "return": "return"}
"""Figures of a curve, if known, and their names in the picture."""
SHARES = ("success_rate", "spl")
"""Those of them that are shares, from 0 to 1."""
SPREAD = "min to max"
"""What the spread is: three seeds are too few for an interval."""
FILES = _CSV, _JSON, _PICTURE = "curve.csv", "curve.json", "curve.png"
"""Names of the files that `LearningCurves.write` writes."""
SEED_FOLDERS = "seed-"
"""Beginning of the name of each seed's folder, before the seed."""

Numbers = Float64[np.ndarray, "points"]
Curve = Mapping[str, Sequence[float]]
"""A run's curve: `samples`, and each of `FIGURES` that is known, as in an agent's file."""


class Spread(NamedTuple):
    """A figure over all seeds, where all have been measured."""

    samples: Numbers
    mean: Numbers
    lowest: Numbers
    highest: Numbers


@dataclass(frozen=True)
class LearningCurves:
    """The learning curves of runs that differ only in their seeds."""

    plan: TrainingPlan
    """The plan of the first run."""
    curves: Mapping[int, Curve]
    """The curve of each seed; one or more."""

    @property
    def names(self) -> tuple[str, ...]:
        """Those of `FIGURES` that are known of all seeds."""
        return tuple(name for name in FIGURES if all(name in c for c in self.curves.values()))

    def values(self, name: str) -> Float64[np.ndarray, "seeds points"]:
        """Return a figure of each seed at the samples of `spread`.

        Seeds that were measured after different numbers of samples are interpolated linearly.
        """
        samples = self._samples
        each = [np.interp(samples, c["samples"], c[name]) for c in self.curves.values()]
        return np.asarray(each, np.float64)

    def spread(self, name: str) -> Spread:
        """Return mean and range of a figure over the seeds."""
        each = self.values(name)
        return Spread(self._samples, each.mean(axis=0), each.min(axis=0), each.max(axis=0))

    @property
    def _samples(self) -> Numbers:
        """Every number of samples after which a seed was measured, between those of all seeds."""
        points = [np.asarray(curve["samples"], np.float64) for curve in self.curves.values()]
        first, last = max(row[0] for row in points), min(row[-1] for row in points)
        union = np.unique(np.concatenate(points))
        return np.asarray(union[(first <= union) & (union <= last)], np.float64)

    @property
    def facts(self) -> dict[str, Any]:
        """The curves as plain data: of each figure mean, minimum, maximum, and each seed's row."""
        facts: dict[str, Any] = {"task": self.plan.task, "algorithm": self.plan.algorithm}
        facts |= {"seeds": list(self.curves), "spread": SPREAD, "samples": self._samples.tolist()}
        for name in self.names:
            _, *rows = self.spread(name)
            means = zip(("mean", "min", "max"), (row.tolist() for row in rows), strict=True)
            facts[name] = dict(means)
            each = zip(self.curves, self.values(name).tolist(), strict=True)
            facts[name]["seeds"] = {str(seed): row for seed, row in each}
        return facts

    @property
    def csv(self) -> str:
        """The curves as a table with a line for each figure and number of samples."""
        lines = [",".join(("figure", "samples", "mean", "min", "max", *map(_column, self.curves)))]
        for name in self.names:
            rows = np.column_stack((*self.spread(name), *self.values(name)))
            lines += [f"{name},{','.join(f'{value:.7g}' for value in row)}" for row in rows]
        return "\n".join(lines) + "\n"

    @property
    def last(self) -> dict[str, tuple[float, float, float]]:
        """Mean, minimum and maximum of each figure at the end; empty if no seeds overlap."""
        if not len(self._samples):
            return {}
        spreads = {name: self.spread(name) for name in self.names}
        return {
            name: (float(found.mean[-1]), float(found.lowest[-1]), float(found.highest[-1]))
            for name, found in spreads.items()
        }

    def write(self, folder: Path) -> None:
        """Write table (CSV and JSON) and picture into a folder.

        Raises:
            InputError: They cannot be written.
        """
        write_text(folder / _CSV, self.csv)
        write_text(folder / _JSON, json.dumps(self.facts, indent=1) + "\n")
        save_figure(self.figure(), folder / _PICTURE)

    def figure(self) -> Figure:
        """Return the picture: the mean, the range in a lighter shade, each seed as a thin line."""
        from matplotlib.figure import Figure  # slow to load
        from matplotlib.ticker import EngFormatter

        shares = [name for name in self.names if name in SHARES]
        figure = Figure(figsize=(7, 3.2), layout="constrained")
        axes = figure.subplots(1, 2 if shares else 1, squeeze=False)[0]
        panels = ([*shares], ["return"]) if shares else (["return"],)
        for panel, names in zip(axes, panels, strict=True):
            for name, colour in zip(names, SERIES, strict=False):
                self._draw(panel, name, colour)
            panel.set(xlabel="samples")
            panel.xaxis.set_major_formatter(EngFormatter(sep=""))  # 80k, not 80000 beside 100000.
            panel.legend(edgecolor="none")  # Its ground keeps it legible on a line.
            panel.grid(alpha=0.3)
        if shares:
            axes[0].set_ylim(0, 1)
        if len(self.curves) > 1:
            figure.suptitle(self.caption, fontsize=9)
        return figure

    @property
    def caption(self) -> str:
        """What the picture shows, of several seeds."""
        return f"Mean of {len(self.curves)} seeds; shaded: {SPREAD}; thin lines: each seed"

    def _draw(self, panel: Axes, name: str, colour: str) -> None:
        spread = self.spread(name)
        style: dict[str, Any] = {"color": colour, "label": FIGURES[name]}
        panel.plot(spread.samples, spread.mean, marker=".", **style)
        if len(self.curves) == 1:
            return
        panel.fill_between(
            spread.samples, spread.lowest, spread.highest, color=colour, alpha=0.2, linewidth=0
        )
        for curve in self.curves.values():  # To their own ends, beyond what all have reached.
            panel.plot(curve["samples"], curve[name], color=colour, linewidth=0.6, alpha=0.6)


def read_curves(sources: Sequence[Path]) -> LearningCurves:
    """Read the learning curves of runs.

    Args:
        sources: Folders of single runs, or of the runs of several seeds; or agents' files, each
            with the curve of its run until it was saved. Runs without a measurement so far are
            left out.

    Raises:
        InputError: A folder holds no run, a file no agent, the runs differ in more than their
            seeds, two have the same seed, or none has been measured.
    """
    found: dict[int, _Run] = {}
    for run in (run for source in sources for run in _runs(source)):
        first = next(iter(found.values()), run)
        others = differences(_shared(run.plan), _shared(first.plan))
        if others:
            expected = f"a plan that differs from that of {first.path} only in its seed"
            raise InputError(run.plan_file, expected, "; ".join(others))
        if run.plan.seed in found:
            expected = f"another seed than that of {found[run.plan.seed].path}"
            raise InputError(run.plan_file, expected, str(run.plan.seed))
        found[run.plan.seed] = run
    curves = {seed: run.curve for seed, run in sorted(found.items()) if run.curve.get("samples")}
    if not curves:
        named = ", ".join(map(str, sources))
        raise InputError(named, "a run that has been measured", "none; see `evaluation.every`")
    return LearningCurves(found[min(curves)].plan, curves)


def check_agent(curves: LearningCurves, plan: TrainingPlan) -> None:
    """Check that an agent is one of those whose learning the curves show.

    Args:
        curves: The curves.
        plan: The plan of the agent's training.

    Raises:
        InputError: Its plan differs in more than seed and samples, or no curve has its seed.
    """
    # A run may have been given more samples after its best agent was saved.
    ignored = {"n_timesteps": plan.n_timesteps}
    others = differences(_shared(plan), _shared(curves.plan) | ignored)
    if others:
        raise InputError("--runs", "runs with the plan of this agent", "; ".join(others))
    if plan.seed not in curves.curves:
        found = ", ".join(map(str, curves.curves))
        raise InputError("--runs", f"the run of the agent's seed, {plan.seed}, too", found)


def spread_text(name: str, spread: tuple[float, float, float]) -> str:
    """Return a figure with its spread as text: `success 0.91 (0.88 to 0.93)`."""
    mean, lowest, highest = spread
    return f"{FIGURES[name]} {mean:.2f} ({lowest:.2f} to {highest:.2f})"


def seeds_text(seeds: Collection[int]) -> str:
    """Return seeds as text: `3 seeds (0, 1, 2)`."""
    return f"{many(len(seeds), 'seed')} ({', '.join(map(str, seeds))})"


class _Run(NamedTuple):
    """A run whose curve is read."""

    path: Path
    """Its folder, or the file of an agent of it."""
    plan_file: Path
    """The file with its plan."""
    plan: TrainingPlan
    """The plan."""
    curve: Curve
    """The curve; empty before the first measurement."""


def _runs(source: Path) -> Iterator[_Run]:
    """Yield the run in a folder, those of all seeds in it, or the run of an agent's file."""
    if source.is_file():
        training = read_agent(source).training
        yield _Run(source, source, training.plan, training.curve)
        return
    paths = [source, *sorted(source.glob(f"{SEED_FOLDERS}*"))]
    runs = [run for run in map(RunFolder, paths) if run.plan.is_file() and run.monitor.is_file()]
    if not runs:
        expected = "the folder of a training run or of several seeds, or an agent's file"
        raise InputError(source, expected)
    for run in runs:
        # The agent of the last checkpoint has the whole curve.
        curve = read_agent(run.last).training.curve if run.last.is_file() else {}
        yield _Run(run.path, run.plan, read_plan(run.plan, tried=False, saved=True), curve)


def _shared(plan: TrainingPlan) -> dict[str, Any]:
    """Return what the plans of several seeds share."""
    return {name: value for name, value in to_plain(plan).items() if name != "seed"}


def _column(seed: int) -> str:
    return f"seed_{seed}"
