"""`albot results`: measure the table of all agents, odometers and kinds of worlds."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from albot_cli import completion
from albot_cli.count_type import CountType
from albot_cli.outputs import JSON, check_file
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_agents.evaluation.comparison import Figures, PairedTrials

_PAGE = Path("docs/results.md")
"""The project's page of results, in a clone."""
_PLAN_SEEDS = "2000..2002"
"""Seeds in each floor plan if none are given. It is not click's default, so that seeds without
plans can be refused."""


@click.command()
@click.option(
    "--out",
    type=PathType(dir_okay=False),
    default=lambda: _PAGE if _PAGE.exists() else Path(_PAGE.name),
    show_default=f"{_PAGE} in a clone of the project, elsewhere {_PAGE.name}",
    help="The page, a .md file; the figures go into a JSON file beside it.",
)
@click.option(
    "--task",
    "tasks",
    multiple=True,
    shell_complete=completion.task_names,
    help="Measure only this task; repeatable. Rows of other tasks stay.",
)
@click.option(
    "--seeds",
    default="2000..2039",
    show_default=True,
    metavar="A..B",
    help="Seeds of random worlds, both included.",
)
@click.option(
    "--plans",
    type=PathType(file_okay=False, exists=True),
    help="Folder of real floor plans in XML; without it, there are no rows for them.",
)
@click.option(
    "--plan-seeds",
    metavar="A..B",
    help=f"Seeds of the episodes in each floor plan.  [default: {_PLAN_SEEDS}]",
)
@click.option("--jobs", type=CountType(1), help="Processes.  [default: one a core]")
@JSON
def command(
    out: Path,
    tasks: tuple[str, ...],
    seeds: str,
    plans: Path | None,
    plan_seeds: str | None,
    jobs: int | None,
    as_json: bool,
) -> int:
    """Measure all agents in all tasks, and write the page of results.

    The page is rewritten after each task. If Ctrl-C stops it, the exit status is 130, and only the
    figures of the current task are lost. A page whose figures are not beside it is not overwritten.
    """
    from albot_agents.evaluation.comparison import COMPARISONS, PLANS, RANDOM, plan_paired_trials
    from albot_agents.evaluation.plan import parse_seeds
    from albot_agents.evaluation.results_page import read_figures, render_page, save_figures
    from albot_agents.task import find_task
    from albot_core.files import write_text

    known = [comparison.task for comparison in COMPARISONS]
    tasks = tuple(map(find_task, tasks))
    for task in tasks:
        if task not in known:
            raise InputError("--task", f"one of {', '.join(known)}", task)
    if plans is None and plan_seeds is not None:
        raise InputError("--plan-seeds", "--plans, the floor plans that they are for", "none")
    if plans is not None and not any(plans.glob("*.xml")):
        raise InputError("--plans", "a folder of floor plans in XML", str(plans))
    plan_seeds = _PLAN_SEEDS if plan_seeds is None else plan_seeds
    if out.suffix != ".md":
        raise InputError("--out", "a name that ends in .md", str(out))
    figures = out.with_suffix(".json")
    if out.exists() and not figures.exists():
        raise InputError(
            out, f"a page with its figures in {figures.name}, or no file", "a page alone"
        )
    check_file(out, force=True)  # Existing rows are kept.
    read_figures(figures)  # A file that is not one of figures raises before the work begins.
    comparisons = [
        comparison for comparison in COMPARISONS if not tasks or comparison.task in tasks
    ]
    worlds = {kind: [spec] for kind, spec in RANDOM.items()}
    ranges = dict.fromkeys(RANDOM, parse_seeds(seeds))
    if plans is not None:
        worlds[PLANS] = [str(plans / "*.xml")]
        ranges[PLANS] = parse_seeds(plan_seeds, "--plan-seeds")
    planned = [plan_paired_trials([comparison], worlds, ranges) for comparison in comparisons]
    said = ["albot", "results", *(word for task in tasks for word in ("--task", task))]
    said += ["--seeds", seeds]
    if plans is not None:
        said += ["--plans", "$ALBOT_DATA/plans", "--plan-seeds", plan_seeds]
    rows, measured = [], 0
    for found in _measure(planned, jobs or os.cpu_count() or 1):
        rows = save_figures(found, _line(said), figures)
        write_text(out, render_page(rows))
        measured += len(found)
    facts = {"rows": rows, "files": {"page": str(out), "figures": str(figures)}}
    click.echo(json.dumps(facts) if as_json else f"{measured} rows\n{out}\n{figures}")
    return 0


def _measure(planned: list[list[PairedTrials]], jobs: int) -> Iterator[Figures]:
    """Yield the figures of one task after another."""
    from albot_agents.evaluation.comparison import run_paired_trials

    before = 0
    with progress("results", sum(map(len, planned)), "trials") as update:
        for paired_trials in planned:

            def over(done: int, before: int = before) -> None:
                update(before + done)

            yield run_paired_trials(paired_trials, jobs, over)
            before += len(paired_trials)


def _line(words: list[str]) -> str:
    """Return the words as a command line; variables such as $ALBOT_DATA stay unquoted."""
    return " ".join(word if word.startswith("$") else shlex.quote(word) for word in words)
