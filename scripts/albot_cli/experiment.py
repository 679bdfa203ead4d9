"""`albot experiment`: repeat the papers' experiments."""

from __future__ import annotations

import json
from pathlib import Path

import click

from albot_cli.outputs import check_folder
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_env.experiments.registry import EXPERIMENTS, find_experiment
from albot_env.experiments.report import cell, rows


@click.group()
def command() -> None:
    """Repeat the papers' experiments and see our figures beside theirs."""


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def list_experiments(as_json: bool) -> None:
    """List the experiments."""
    rows = [{"id": e.id, "title": e.title, "seeds": e.seeds} for e in EXPERIMENTS.values()]
    if as_json:
        click.echo(json.dumps({"experiments": rows}))
        return
    for row in rows:
        click.echo(f"{row['id']}  {row['title']}, {row['seeds']} seeds")


@command.command("run")
@click.argument("name", metavar="ID")
@click.option("--seeds", type=int, help="How many seeds, from 0 on.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder for the report: Markdown, pictures, JSON.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def run_experiment(name: str, seeds: int | None, out: Path | None, as_json: bool) -> None:
    """Run the experiment ID; `albot experiment list` names them."""
    experiment = find_experiment(name)
    count = experiment.seeds if seeds is None else seeds
    if count < 1:
        raise InputError("--seeds", "at least 1", str(count))
    if out is not None:
        check_folder(out)
    with progress(experiment.id, count, "seeds") as tell:
        report = experiment.run(range(count), tell)
    files = report.write(out) if out else []
    if as_json:
        click.echo(json.dumps(report.as_json() | {"files": [str(path) for path in files]}))
        return
    click.echo(f"{report.id}: {report.title}\n")
    paper, measured = dict(rows(report.paper)), rows(report.measured)
    width = max(len(name) for name, _ in measured)
    click.echo(f"{'':{width}}  {'paper':>8}  {'measured':>8}")
    for name, value in measured:
        click.echo(f"{name:{width}}  {cell(paper.get(name)):>8}  {cell(value):>8}")
    click.echo("\nreached" if report.holds else "\nnot reached")
    for path in files:
        click.echo(str(path))
