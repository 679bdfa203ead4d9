"""`albot agents`: list the agents, write model cards, and draw learning curves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from albot_cli.outputs import (
    FORCE,
    JSON,
    FigureFile,
    check_file,
    check_folder,
    check_suffix,
    figure_options,
    filled_folder,
)
from albot_cli.path_type import PathType
from albot_core.errors import InputError

_FILE, _FOLDER, _RUN = PathType(dir_okay=False), PathType(file_okay=False), PathType()


@click.group()
def command() -> None:
    """List the agents; write the card of a trained one; draw learning curves."""


@command.command("list")
@JSON
def list_agents(as_json: bool) -> None:
    """List the agents, what each does, and the model cards of the trained ones."""
    from albot_agents.registry import agent_names, find_agent, make_agent
    from albot_agents.trained.trained_agent import card_path

    rows = []
    for name in agent_names():
        entry = find_agent(name)
        row: dict[str, Any] = {"name": name, "summary": entry.summary, "mapper": entry.mapper}
        row["knows_truth"] = entry.file is None and make_agent(name).knows_truth
        if entry.file is not None:
            row |= {"task": entry.file.task, "card": str(card_path(name))}
        rows.append(row)
    if as_json:
        click.echo(json.dumps({"agents": rows}))
        return
    width = max(len(row["name"]) for row in rows)
    for row in rows:
        card = f"  {row['card']}" if "card" in row else ""
        click.echo(f"{row['name']:<{width}}  {row['summary']}{card}")


@command.command("card")
@click.argument("file", type=_FILE)
@click.option(
    "--evaluation",
    "evaluations",
    multiple=True,
    type=_FILE,
    help="Figures to show: evaluation.json of `albot evaluate --out`; repeatable.",
)
@click.option(
    "--runs",
    multiple=True,
    type=_RUN,
    help="Show the learning curve of all seeds in this folder of `albot train --seeds`, in this "
    "run's, or in this agent's file; repeatable.  [default: the agent's own curve]",
)
@click.option("--out", type=_FILE, help="The card, a .md file.  [default: FILE's name with .md]")
@figure_options("the learning curve")
@FORCE
@JSON
def write_agents_card(
    file: Path,
    evaluations: tuple[Path, ...],
    runs: tuple[Path, ...],
    out: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> None:
    """Write the model card of the trained agent in FILE, and its learning curve."""
    from albot_agents.trained.agent_file import read_agent
    from albot_agents.trained.card import own_curve, read_evaluation, write_card
    from albot_agents.training.learning_curve import check_agent, read_curves

    card = out or file.with_suffix(".md")
    check_suffix(card, ".md", option="--out")
    agent = read_agent(file)  # A file of another kind is told before pictures that exist.
    for path in (card, card.with_suffix(".png")):
        if path.resolve() == file.resolve():
            raise InputError("--out", "another file than the agent's", str(path))
        check_file(path, force=force)
    figures = [read_evaluation(path, agent) for path in evaluations]
    curves = read_curves(runs) if runs else None
    if curves is not None:
        check_agent(curves, agent.training.plan)
    shown = own_curve(agent) if curves is None else curves
    if figure is not None and shown is None:
        raise InputError("--figure", "an agent with a learning curve", f"{file} without one")
    if figure is not None:
        figure.check_apart((card, card.with_suffix(".png"), file))
    written = write_card(agent, file.stem, card, figures, curves)
    if figure is not None and shown is not None:
        written.append(figure.save(shown.figure()))
    if as_json:
        click.echo(json.dumps({"files": [str(path) for path in written]}))
        return
    for path in written:
        click.echo(path)


@command.command("curve")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=_RUN)
@click.option(
    "--out",
    type=_FOLDER,
    help="Folder for curve.csv, curve.json and curve.png.  [default: RUN, if it is one folder]",
)
@figure_options("the learning curve")
@FORCE
@JSON
def write_curve(
    runs: tuple[Path, ...],
    out: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> None:
    """Write the learning curve of a training's runs, with its spread over their seeds.

    RUN is the folder of `albot train --seeds`, which writes the same at its end, that of a run, or
    the file of an agent, which has the curve until it was saved. Several runs must differ only in
    their seeds. The picture shows the mean, the range from the lowest to the highest, and each seed
    as a thin line; the mean ends where the shortest run does.
    """
    from albot_agents.training.learning_curve import (
        FILES,
        SPREAD,
        read_curves,
        seeds_text,
        spread_text,
    )

    if out is None and (len(runs) > 1 or runs[0].is_file()):
        raise InputError(
            "--out", "a folder, for the curve of agents' files or of several runs", "none"
        )
    # The files in the runs' own folder are theirs, made again.
    target = runs[0] if out is None else out
    check_folder(target, FILES, force=force or out is None, figure=figure)
    if figure is not None:
        figure.check_apart(runs)
    curves = read_curves(runs)
    with filled_folder(target) as scratch:
        curves.write(scratch)
    written = [target / name for name in FILES]
    if figure is not None:
        written.append(figure.save(curves.figure()))
    if as_json:
        click.echo(json.dumps({**curves.facts, "files": [str(path) for path in written]}))
        return
    ends = ", ".join(spread_text(name, found) for name, found in curves.last.items())
    head = f"{curves.plan.task} with {curves.plan.algorithm}, {seeds_text(curves.curves)}"
    click.echo(f"{head}, mean ({SPREAD}) at the end: {ends or 'none that all have'}")
    for path in written:
        click.echo(path)
