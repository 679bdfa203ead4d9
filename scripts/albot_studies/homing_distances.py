"""Homing against distance: how often, and how straight, agents come home after longer journeys.

All agents meet the same offices, starts and outward journeys, which none of the trained ones saw in
training. `patch-homing` acts in `Albot/HomingByMap-v0`, where nothing has changed, the others in
`Albot/Homing-v0`.
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
from albot_agents.registry import find_agent
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.files import atomic_write, write_text
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_env.tasks.homing_by_map.changes import ChangesConfig
from albot_env.tasks.homing_by_map.task import HomingByMapConfig
from albot_maps.generators.spec import seeded

AGENTS = {
    "oracle": "Albot/Homing-v0",
    "albot1-homing": "Albot/Homing-v0",
    "patch-homing": "Albot/HomingByMap-v0",
    "homing-blind": "Albot/Homing-v0",
    "homing-mapless": "Albot/Homing-v0",
    "path-integration": "Albot/Homing-v0",
}
"""The agents, and the task in which each acts."""
LENGTHS = 10.0, 20.0, 40.0, 80.0, 160.0
"""Lengths of the outward journeys (m)."""
_UNCHANGED = ChangesConfig(door_shut=0.0, door_opened=0.0, carried=0.0, furniture_moved=0.0)


def plan_trial(agent: str, length: float, world: str, seed: int) -> Trial:
    """Plan an agent's episode after an outward journey of some length (m)."""
    task, outing = AGENTS[agent], OutwardJourneyConfig(shortest=length, longest=length)
    config: Any = HomingConfig(outing=outing)
    if task == "Albot/HomingByMap-v0":
        config = HomingByMapConfig(outing=outing, changes=_UNCHANGED)
    # There is one journey from each start, so all agents meet the same.
    settings = find_agent(agent).environment(task, {"config": config, "journeys": 1})
    return Trial(task=task, agent=agent, world=world, seed=seed, settings=settings)


def measure(
    agents: Sequence[str], lengths: Sequence[float], worlds: str, seeds: range
) -> list[dict[str, Any]]:
    """Let agents drive home in each world after journeys of each length.

    Returns:
        One row per agent and length.
    """
    outcomes: dict[tuple[str, float], list[Outcome]] = {
        (agent, length): [] for agent in agents for length in lengths
    }
    with progress("homing", len(outcomes) * len(seeds), "episodes") as tell:
        for seed in seeds:
            world = seeded(worlds, seed)
            for done, ((agent, length), ends) in enumerate(outcomes.items()):
                tell((seed - seeds[0]) * len(outcomes) + done, f"{agent}, {length:g} m")
                ends.append(run_trial(plan_trial(agent, length, world, seed)))
    return [_row(agent, length, ends) for (agent, length), ends in outcomes.items()]


def _row(agent: str, length: float, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    figures = summarise(outcomes)
    return {
        "agent": agent,
        "length": length,
        "episodes": len(outcomes),
        "distance_home": figures["mean_initial_distance_m"],
        "success": figures["success_rate"],
        "success_ci95": figures["ci95"],
        "spl": figures["spl"],
        "spl_ci95": figures["spl_ci95"],
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as Markdown: one table for success and one for SPL."""
    lengths = list(dict.fromkeys(row["length"] for row in rows))
    of = {(row["agent"], row["length"]): row for row in rows}
    agents = list(dict.fromkeys(row["agent"] for row in rows))
    lines = []
    for title, name, style in (("success", "success", ".0%"), ("SPL", "spl", ".2f")):
        lines += [
            f"| {title} (95 %) | " + " | ".join(f"{length:g} m" for length in lengths) + " |",
            "|---|" + "---|" * len(lengths),
        ]
        for agent in agents:
            cells = []
            for row in (of[agent, length] for length in lengths):
                low, high = row[f"{name}_ci95"]
                cells.append(f"{row[name]:{style}} ({low:{style}} to {high:{style}})")
            lines.append(f"| {agent} | " + " | ".join(cells) + " |")
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
    agents, markers = list(dict.fromkeys(row["agent"] for row in rows)), "so^vDP"
    for axes, name, title in zip(panels, ("success", "spl"), ("success", "SPL"), strict=True):
        for k, agent in enumerate(agents):
            its = [row for row in rows if row["agent"] == agent]
            middle = np.array([row[name] for row in its])
            low, high = np.transpose([row[f"{name}_ci95"] for row in its])
            # Beside each other, so that no interval hides another.
            lengths = np.array([row["length"] for row in its]) * 1.03 ** (k - len(agents) / 2)
            spread = np.maximum(0.0, (middle - low, high - middle))
            axes.errorbar(
                lengths, middle, spread, fmt=f"{markers[k]}-", ms=5, capsize=2, label=agent
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
    "--agent", "agents", multiple=True, type=click.Choice(list(AGENTS)), help="Only this."
)
@click.option("--length", "lengths", multiple=True, type=float, help="Only journeys of this (m).")
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
    rows = measure(agents or tuple(AGENTS), lengths or LENGTHS, worlds, parse_seeds(seeds))
    if out is not None:
        write_text(out, table(rows))
    if png is not None:
        draw(rows, png)
    click.echo(json.dumps({"rows": rows}) if as_json else table(rows))
