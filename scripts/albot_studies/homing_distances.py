"""Homing against distance: how often, and how straight, agents come home after longer journeys.

All agents meet the same offices, starts and outward journeys, which none of the trained ones saw in
training. `patch-homing` acts in `Albot/HomingByMap-v0`, where nothing has changed, the others in
`Albot/Homing-v0`. Agents of several trainings with the same plan make one row, so that what is
compared is the plan and not the luck of one seed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_agents.evaluation.plan import Trial, parse_seeds
from albot_agents.evaluation.summary import summarise
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_agents.registry import check_agent, find_agent
from albot_agents.training.learning_curve import SEED_FOLDERS
from albot_agents.training.run_files import LAST_AGENT
from albot_cli.number_types import RealType
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.files import atomic_write, write_text
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_env.tasks.homing_by_map.changes import ChangesConfig
from albot_env.tasks.homing_by_map.task import HomingByMapConfig
from albot_maps.generators.spec import seeded

HOMING, BY_MAP = "Albot/Homing-v0", "Albot/HomingByMap-v0"
AGENTS = (
    "oracle",
    "albot1-homing",
    "patch-homing",
    "homing-blind",
    "homing-mapless",
    "path-integration",
)
"""The agents that are measured if none are named."""
LENGTHS = 10.0, 20.0, 40.0, 80.0, 160.0
"""Lengths of the outward journeys (m)."""
_UNCHANGED = ChangesConfig(door_shut=0.0, door_opened=0.0, carried=0.0, furniture_moved=0.0)


def trained_files(name: str) -> tuple[str, ...]:
    """Return the agents of a row: one by its name or file, or those of a folder's trainings.

    Raises:
        InputError: The folder holds no training that has ended.
    """
    folder = Path(name)
    if not name or not folder.is_dir():
        return (name,)
    files = sorted(folder.glob(f"{SEED_FOLDERS}*/{LAST_AGENT}"))
    if not files:
        expected = f"a folder of `albot train --seeds`, with {SEED_FOLDERS}*/{LAST_AGENT}"
        raise InputError(folder, expected, "none")
    return tuple(map(str, files))


def plan_trial(agent: str, length: float, world: str, seed: int) -> Trial:
    """Plan an agent's episode after an outward journey of some length (m).

    Raises:
        InputError: There is no such agent, or it comes home in neither task.
    """
    outing = OutwardJourneyConfig(shortest=length, longest=length)
    task, config = HOMING, HomingConfig(outing=outing)
    if not find_agent(agent).attempts(HOMING):
        check_agent(agent, BY_MAP)
        task, config = BY_MAP, HomingByMapConfig(outing=outing, changes=_UNCHANGED)
    # There is one journey from each start, so all agents meet the same.
    settings = find_agent(agent).environment(task, {"config": config, "journeys": 1})
    return Trial(task=task, agent=agent, world=world, seed=seed, settings=settings)


def measure(
    rows: Sequence[str], lengths: Sequence[float], worlds: str, seeds: range
) -> list[dict[str, Any]]:
    """Let agents drive home in each world after journeys of each length.

    Args:
        rows: The agents: names, files, or folders with the trainings of several seeds.
        lengths: Lengths of the outward journeys (m).
        worlds: World spec; each seed is a world.
        seeds: Seeds of worlds and episodes.

    Returns:
        One row per agent and length.

    Raises:
        InputError: There is no such agent, folder or world.
    """
    agents = {row: trained_files(row) for row in rows}
    outcomes: dict[tuple[str, str, float], list[Outcome]] = {
        (row, agent, length): []
        for row, files in agents.items()
        for agent in files
        for length in lengths
    }
    for _, agent, length in outcomes:
        plan_trial(agent, length, worlds, seeds[0])  # An unknown one is refused before any drives.
    with progress("homing", len(outcomes) * len(seeds), "episodes") as tell:
        for seed in seeds:
            world = seeded(worlds, seed)
            for done, ((row, agent, length), ends) in enumerate(outcomes.items()):
                tell((seed - seeds[0]) * len(outcomes) + done, f"{row}, {length:g} m")
                ends.append(run_trial(plan_trial(agent, length, world, seed)))
    return [
        _row(row, length, [outcomes[row, agent, length] for agent in agents[row]])
        for row in rows
        for length in lengths
    ]


def _row(name: str, length: float, trainings: Sequence[Sequence[Outcome]]) -> dict[str, Any]:
    """Return the figures of an agent, or the means of its trainings with their least and greatest.

    The trainings meet the same episodes, so these together are no larger a sample.
    """
    figures = [summarise(outcomes) for outcomes in trainings]
    row = {
        "agent": Path(name).name if len(trainings) > 1 else name,
        "trainings": len(trainings),
        "length": length,
        "episodes": len(trainings[0]),
        "distance_home": figures[0]["mean_initial_distance_m"],
    }
    for figure, interval in (("success_rate", "ci95"), ("spl", "spl_ci95")):
        each = [its[figure] for its in figures]
        column = figure.removesuffix("_rate")
        row[column] = sum(each) / len(each)
        alone = len(each) == 1
        row[f"{column}_range"] = figures[0][interval] if alone else [min(each), max(each)]
    return row


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as Markdown: one table for success and one for SPL.

    In brackets stand 95 % intervals, and the least and the greatest of several trainings.
    """
    lengths = list(dict.fromkeys(row["length"] for row in rows))
    of = {(row["agent"], row["length"]): row for row in rows}
    agents = list(dict.fromkeys(row["agent"] for row in rows))
    lines = []
    for title, name, style in (("success", "success", ".0%"), ("SPL", "spl", ".2f")):
        lines += [
            f"| {title} | " + " | ".join(f"{length:g} m" for length in lengths) + " |",
            "|---|" + "---|" * len(lengths),
        ]
        for agent in agents:
            cells, trainings = [], of[agent, lengths[0]]["trainings"]
            for row in (of[agent, length] for length in lengths):
                low, high = row[f"{name}_range"]
                cells.append(f"{row[name]:{style}} ({low:{style}} to {high:{style}})")
            label = f"{agent}, {trainings} trainings" if trainings > 1 else agent
            lines.append(f"| {label} | " + " | ".join(cells) + " |")
        lines.append("")
    means = (of[agents[0], length]["distance_home"] for length in lengths)
    lines.append("Mean length of the shortest way home: " + ", ".join(f"{m:.1f} m" for m in means))
    return "\n".join((*lines, ""))


def draw(rows: Sequence[dict[str, Any]], out: Path) -> None:
    """Draw success and SPL against the length of the outward journey."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to load
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True)
    agents, markers = list(dict.fromkeys(row["agent"] for row in rows)), "so^vDP<>X*"
    for axes, name, title in zip(panels, ("success", "spl"), ("success", "SPL"), strict=True):
        for k, agent in enumerate(agents):
            its = [row for row in rows if row["agent"] == agent]
            middle = np.array([row[name] for row in its])
            low, high = np.transpose([row[f"{name}_range"] for row in its])
            # Beside each other, so that no interval hides another.
            lengths = np.array([row["length"] for row in its]) * 1.03 ** (k - len(agents) / 2)
            spread = np.maximum(0.0, (middle - low, high - middle))
            axes.errorbar(
                lengths,
                middle,
                spread,
                fmt=f"{markers[k % len(markers)]}-",
                ms=5,
                capsize=2,
                label=agent,
            )
        axes.set_xscale("log")
        lengths = sorted({row["length"] for row in rows})
        axes.set_xticks(lengths, [f"{length:g}" for length in lengths])
        axes.minorticks_off()
        axes.set(xlabel="outward journey, m", ylabel=title, ylim=(-0.03, 1.05))
        axes.grid(alpha=0.3)
    panels[1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    FigureCanvasAgg(figure)
    with atomic_write(out) as stream:
        figure.savefig(stream, format="png", dpi=110)


@click.command()
@click.option(
    "--agent",
    "agents",
    multiple=True,
    help="Only this: a name, a file, or a folder of `albot train --seeds`, all seeds in one row.",
)
@click.option(
    "--length", "lengths", multiple=True, type=RealType(0), help="Only journeys of this (m)."
)
@click.option("--worlds", default="random:office", show_default=True)
@click.option("--seeds", default="40000..40019", show_default=True)
@click.option("--out", type=PathType(), help="File for the tables, as Markdown.")
@click.option("--png", type=PathType(), help="File for the picture.")
@JSON
def command(
    agents: tuple[str, ...],
    lengths: tuple[float, ...],
    worlds: str,
    seeds: str,
    out: Path | None,
    png: Path | None,
    as_json: bool,
) -> None:
    """Measure how often agents come home after journeys of several lengths."""
    rows = measure(agents or AGENTS, lengths or LENGTHS, worlds, parse_seeds(seeds))
    if out is not None:
        write_text(out, table(rows))
    if png is not None:
        draw(rows, png)
    click.echo(json.dumps({"rows": rows}) if as_json else table(rows))
