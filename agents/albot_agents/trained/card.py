"""Write a trained agent's model card: its task, its training and its results."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from albot_agents.trained.agent_file import AgentFile
from albot_agents.trained.encoders import PLANNER
from albot_agents.training.learning_curve import (
    SPREAD,
    LearningCurves,
    seeds_text,
    spread_text,
)
from albot_agents.training.plan import TrainingPlan
from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, deep_merge, read_record, to_plain
from albot_core.robot import DEFAULT_ROBOT
from albot_env.tasks.core.parts.map_patch import CHANNELS

_FIGURES = {
    "success_rate": "success",
    "spl": "SPL",
    "soft_spl": "soft SPL",
    "precision": "precision",
    "recall": "recall",
    "mean_coverage": "coverage",
    "coverage_auc": "coverage over 200 m",
    "rooms_share": "rooms entered",
    "collisions_per_m": "collisions per m",
}
"""Figures of an evaluation on the card, if known, and their names there."""
_INTERVALS = {"success_rate": "ci95", "spl": "spl_ci95", "soft_spl": "soft_spl_ci95"}
_REQUIRED_FIELDS = {
    "task": str, "world_specs": list[str], "seeds": str, "odometer": str, "mapper": str,
    "episodes": int,
}  # fmt: skip
"""Other values of an evaluation on the card, and their types."""
_KINDS: dict[str, Any] = dict.fromkeys(_FIGURES, float | None) | dict.fromkeys(
    _INTERVALS.values(), tuple[float, float] | None
)
"""Types of the figures and intervals."""


def write_card(
    agent: AgentFile,
    name: str,
    path: Path,
    evaluations: Sequence[Mapping[str, Any]] = (),
    runs: LearningCurves | None = None,
) -> list[Path]:
    """Write an agent's card, and beside it the picture of its learning curve if there is one.

    Args:
        agent: The agent.
        name: Its name.
        path: The card, a Markdown file; the picture has the same name with `.png`.
        evaluations: Results of `albot evaluate` (`evaluation.json`).
        runs: The learning curves of several seeds, one of which made the agent; None for its own.

    Returns:
        The files written.

    Raises:
        InputError: They cannot be written.
    """
    picture = path.with_suffix(".png")
    curves = own_curve(agent) if runs is None else runs
    sections = [_heading(agent, name), _origin(agent)]
    if evaluations:
        sections.append(_table(evaluations))
    written = [path]
    if curves is not None:
        save_figure(curves.figure(), picture)
        written.append(picture)
        told = "" if runs is None else f"{_spread(agent, runs)}\n\n"
        sections.append(f"## Learning curve\n\n{told}![Learning curve]({picture.name})")
    plan = yaml.safe_dump(to_plain(agent.training.plan), sort_keys=False)
    sections.append(f"## Plan\n\n```yaml\n{plan}```")
    write_text(path, "\n\n".join(sections) + "\n")
    return written


def read_evaluation(path: Path, agent: AgentFile) -> dict[str, Any]:
    """Read an agent's results from `evaluation.json` of `albot evaluate`.

    Raises:
        InputError: The file is missing, is not such a file, or is about another agent.
    """
    found, where = read_json(path), Location(path)
    if not isinstance(found, dict) or "success_rate" not in found:
        raise InputError(path, "the figures of `albot evaluate`", "other data")
    if found.get("fingerprint") != agent.fingerprint:
        expected = "figures of this agent, with the fingerprint of its weights"
        raise where.at("fingerprint").error(expected, f"those of {found.get('agent')}")
    known = _REQUIRED_FIELDS | {name: kind for name, kind in _KINDS.items() if name in found}
    return read_record(known, found, where, others=True)


def own_curve(agent: AgentFile) -> LearningCurves | None:
    """Return the learning curve of an agent's own training; None if it has none."""
    training = agent.training
    if not training.curve.get("samples"):
        return None
    return LearningCurves(training.plan, {training.plan.seed: training.curve})


def _spread(agent: AgentFile, runs: LearningCurves) -> str:
    """Return what the curve of several seeds shows, and how it ends."""
    seed = agent.training.plan.seed
    lines = [f"{runs.caption}. This agent is that of seed {seed}, of {seeds_text(runs.curves)}."]
    if runs.last:
        ends = ", ".join(spread_text(name, spread) for name, spread in runs.last.items())
        lines.append(f"At the end, mean ({SPREAD}): {ends}.")
    return " ".join(lines)


def _heading(agent: AgentFile, name: str) -> str:
    network = agent.network
    lstm = f"{network.lstm_layers} × LSTM {network.lstm_size}, " if network.lstm_layers else ""
    encoders = "".join(f"{each.kind} of {each.part}, " for each in network.encoders)
    layers = " × ".join(map(str, network.layers))
    inputs = f"{network.inputs} inputs"
    if network.candidates:
        inputs = f"{network.candidates} candidates of {network.width} numbers each"
    actions = f"{network.outputs} {'discrete actions' if agent.discrete else 'numbers'}"
    acts = "deterministically: it takes the action with the highest score"
    if network.sampled:
        acts = "by sampling from its policy, as in its training"
        if not network.sampled_statements:
            acts = "by sampling speed and turn rate from its policy; what it says is the mean"
    return (
        f"# {name}\n\nA policy for `{agent.task}`, trained by {agent.training.plan.algorithm}: "
        f"{inputs}, {encoders}{lstm}{layers} {network.activation}, {actions}. It acts "
        f"{acts}."
    )


def _origin(agent: AgentFile) -> str:
    """Return the section about the training."""
    training, plan = agent.training, agent.training.plan
    stages = (plan.env, *(deep_merge(plan.env, stage.env) for stage in plan.curriculum))
    worlds = [stage.get("world", "office-ring") for stage in stages]
    shown = dict.fromkeys(world if isinstance(world, str) else ", ".join(world) for world in worlds)
    rows = {
        "command": f"`{training.command}`",
        "seed": plan.seed,
        **_cloned(plan),
        **_learnt_costs(agent),
        "worlds": "; ".join(f"`{world}`" for world in shown),
        "robot": f"`{agent.settings.get('robot', DEFAULT_ROBOT)}`",
        "mapper": f"`{agent.settings.get('mapper', 'albot1')}`",
        "samples": f"{training.samples:,} in {training.episodes:,} episodes",
        "time": f"{training.seconds / 3600:.2f} h, {training.machine}",
        "versions": ", ".join(f"{name} {number}" for name, number in training.versions.items()),
    }
    lines = [f"| {name} | {value} |" for name, value in rows.items()]
    return "\n".join(("## Training", "", "| | |", "|---|---|", *lines))


def _cloned(plan: TrainingPlan) -> dict[str, str]:
    """Return the row about the pretraining; none without one."""
    its = plan.pretrain
    if its is None:
        return {}
    shown = f"{its.steps:,} samples of `{its.agent}`" if its.agent else f"`{its.demonstrations}`"
    return {"cloned before": shown}


def _learnt_costs(agent: AgentFile) -> dict[str, str]:
    """Return the row about what a planner's cells cost; none without a planner."""
    planner = next((each for each in agent.network.encoders if each.kind == PLANNER), None)
    observed = agent.observation_config
    if planner is None or observed is None:
        return {}
    names = [name for name in CHANNELS if name in observed.map_patch.shown]
    # From -1, not here, to 1, here.
    factors = np.exp(2 * agent.weights[f"{planner.part}.cost_weight"])
    shown = ", ".join(f"{name} × {factor:.2f}" for name, factor in zip(names, factors, strict=True))
    return {"learnt cost of a cell": f"{shown}; of an unknown one × 1"}


def _table(evaluations: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of figures, with 95 % intervals in brackets."""
    names = [name for name in _FIGURES if any(found.get(name) is not None for found in evaluations)]
    head = ["task", "worlds", "seeds", "odometer", "mapper", "episodes"]
    head += [_FIGURES[name] for name in names]
    rows = []
    for found in evaluations:
        worlds = ", ".join(f"`{_portable(spec)}`" for spec in found["world_specs"])
        cells = [found["task"], worlds, found["seeds"], found["odometer"], found["mapper"]]
        cells += [found["episodes"], *(_cell(found, name) for name in names)]
        rows.append(cells)
    lines = [f"| {' | '.join(map(str, row))} |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(("## Figures", "", *lines))


def _portable(spec: str) -> str:
    """Return a world spec; a file below the folder of real data without that machine's folder."""
    data = os.environ.get("ALBOT_DATA")
    if not data or not Path(spec).is_relative_to(data):
        return spec
    return f"$ALBOT_DATA/{Path(spec).relative_to(data).as_posix()}"


def _cell(found: Mapping[str, Any], name: str) -> str:
    value, interval = found.get(name), found.get(_INTERVALS.get(name, ""))
    if value is None:
        return "–"
    return f"{value:.3f}" + (f" ({interval[0]:.3f} to {interval[1]:.3f})" if interval else "")
