"""`albot agents`: list the agents, and write the model cards of trained ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from albot_cli.outputs import FORCE, JSON, FigureFile, check_file, check_suffix, figure_options
from albot_cli.path_type import PathType
from albot_core.errors import InputError

_FILE = PathType(dir_okay=False)


@click.group()
def command() -> None:
    """List the agents; write the model card of a trained one."""


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
@click.option("--out", type=_FILE, help="The card, a .md file.  [default: FILE's name with .md]")
@figure_options("the learning curve")
@FORCE
@JSON
def write_agents_card(
    file: Path,
    evaluations: tuple[Path, ...],
    out: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> None:
    """Write the model card of the trained agent in FILE, and its learning curve."""
    from albot_agents.trained.agent_file import read_agent
    from albot_agents.trained.card import curve_figure, read_evaluation, write_card

    card = out or file.with_suffix(".md")
    check_suffix(card, ".md", option="--out")
    agent = read_agent(file)  # A file of another kind is told before pictures that exist.
    for path in (card, card.with_suffix(".png")):
        if path.resolve() == file.resolve():
            raise InputError("--out", "another file than the agent's", str(path))
        check_file(path, force=force)
    figures = [read_evaluation(path, agent) for path in evaluations]
    curve = agent.training.curve
    if figure is not None and not curve.get("samples"):
        raise InputError("--figure", "an agent with a learning curve", f"{file} without one")
    written = write_card(agent, file.stem, card, figures)
    if figure is not None:
        written.append(figure.save(curve_figure(curve)))
    if as_json:
        click.echo(json.dumps({"files": [str(path) for path in written]}))
        return
    for path in written:
        click.echo(path)
