"""Agents compared episode by episode: a table of the episodes, and differences in the same ones."""

from __future__ import annotations

import csv
import io
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np

from albot_agents.evaluation.measured import MeasuredEpisode
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import Outcome
from albot_agents.task import config_kind, short_name
from albot_core.errors import InputError
from albot_core.evaluation.intervals import bootstrap_clusters
from albot_core.plain_data import differences, to_plain
from albot_core.robot import DEFAULT_ROBOT
from albot_env.tasks.core.observation import ObservationConfig

_SEED = 0
"""Seed of the bootstrap."""
_OWN_SETTINGS = (
    "mapper", "mapper_config", "odometer", "laser", "sonar", "scenes", "compass", "action",
    "observation", "threads", "config",
)  # fmt: skip
"""Settings in which agents may differ; `config` in `_OWN_CONFIG`."""
_OWN_CONFIG = ("actions", "claims", "hints", "observations", "weights")
"""Fields of a task's configuration in which agents may differ, but for the coverage's size."""
_COVERAGE = ("radius", "cell", "spacing", "turn")
"""What decides which ground counts as covered."""

_TOLD = ("is_success", "way_driven")
"""Values of `info` that `FIGURES` has under other names."""

FIGURES: Mapping[str, str] = {
    "success": "success",
    "spl": "SPL",
    "soft_spl": "soft SPL",
    "distance_home": "m from home",
    "coverage_auc": "covered over 200 m",
    "rooms_share": "rooms entered",
    "recall": "recall",
    "collisions": "collisions",
    "driven": "m driven",
}
"""Figures of an episode whose differences are told, and their names in texts."""


def check_same_episodes(trials: Mapping[str, Trial]) -> None:
    """Check that agents would meet the same episodes.

    World, start, outward journey, tour and time limit depend on world, seed and the settings that
    are compared here. Agents may differ in mapper, sensors, observations and actions.

    Args:
        trials: A trial of each agent, by the agent's name.

    Raises:
        InputError: Two agents' settings of episodes differ; the message says in what.
    """
    first, *others = trials
    wanted = _episode_settings(trials[first])
    for agent in others:
        differing = differences(_episode_settings(trials[agent]), wanted)
        if differing:
            expected = f"the episodes of {first}"
            raise InputError(f"agent {agent}", expected, "; ".join(differing))


def _episode_settings(trial: Trial) -> dict[str, Any]:
    """Return what an episode depends on, besides the agent, as plain data."""
    settings = {name: each for name, each in trial.settings.items() if name not in _OWN_SETTINGS}
    config = to_plain(trial.settings.get("config") or config_kind(trial.task)())
    kept = {name: value for name, value in config.items() if name not in _OWN_CONFIG}
    if "observations" in config:
        # None stands for parts that the task chooses, with the default coverage.
        coverage = (config["observations"] or to_plain(ObservationConfig()))["coverage"]
        kept["observations"] = {"coverage": {name: coverage[name] for name in _COVERAGE}}
    usual = {"world": trial.world, "seed": trial.seed, "robot": DEFAULT_ROBOT}
    return {**usual, **to_plain(settings), "config": kept}


def check_same_beginnings(
    outcomes: Sequence[MeasuredEpisode], others: Sequence[MeasuredEpisode]
) -> None:
    """Check that pairs of episodes began at the same pose, to the bit.

    Raises:
        RuntimeError: A pair did not, which is a bug.
    """
    for one, other in zip(outcomes, others, strict=True):
        same = (one.start == other.start).all() and (one.begin == other.begin).all()
        if (one.world, one.seed) != (other.world, other.seed) or not same:
            agents = f"{one.agent} and {other.agent}"
            raise RuntimeError(f"{agents} met different episodes: {one.world}")


def episode_figures(outcome: MeasuredEpisode) -> dict[str, float]:
    """Return the figures of an episode that `FIGURES` names, as far as its task has them."""
    info = outcome.info
    found = {"success": info.get("is_success")}
    found |= {name: info.get(name) for name in ("spl", "soft_spl", "distance_home")}
    found["coverage_auc"] = outcome.coverage_auc
    if outcome.rooms:
        found["rooms_share"] = info["rooms_entered"] / outcome.rooms
    if "right_known" in info:
        found["recall"] = info["recall"]
    found |= {"collisions": outcome.collisions, "driven": outcome.driven}
    return {name: float(value) for name, value in found.items() if value is not None}


def paired_differences(
    outcomes: Sequence[MeasuredEpisode], others: Sequence[MeasuredEpisode]
) -> dict[str, dict[str, Any]]:
    """Return by how much figures of episodes exceed those of others in the same episodes.

    Per figure (see `FIGURES`): `mean` of the differences, its bootstrapped 95 % interval `ci95`, in
    which worlds are drawn with all of their episodes, and in how many episodes the figure is
    `larger`, `smaller` and `equal`.

    Args:
        outcomes: The episodes of one agent.
        others: The episodes of the other one, in the same order.

    Raises:
        RuntimeError: They are not the same episodes, which is a bug.
    """
    check_same_beginnings(outcomes, others)
    if not outcomes:
        return {}
    pairs = [
        (episode_figures(one), episode_figures(other))
        for one, other in zip(outcomes, others, strict=True)
    ]
    worlds = [outcome.world for outcome in outcomes]
    rng, found = np.random.default_rng(_SEED), {}
    for name in FIGURES:
        if not all(name in one and name in other for one, other in pairs):
            continue
        apart = np.array([one[name] - other[name] for one, other in pairs])
        found[name] = {
            "mean": float(apart.mean()),
            "ci95": list(bootstrap_clusters(apart, worlds, rng)),
            "larger": int((apart > 0).sum()),
            "smaller": int((apart < 0).sum()),
            "equal": int((apart == 0).sum()),
        }
    return found


def episodes_csv(outcomes: Sequence[Outcome], options: Sequence[str] = ()) -> str:
    """Return a table of episodes, a row each, as CSV text with a header.

    The columns: task, agent, world, seed and number of steps; the figures of `FIGURES`; the poses
    of home (`start`) and at the beginning (`begin`), x, y, heading (world frame); all other single
    values of the last `info`; and the command that shows the episode. A figure that the task lacks
    is empty.

    Args:
        outcomes: The episodes.
        options: Further options of the command, such as a file of the mapper's parameters.
    """
    rows = [_row(outcome, options) for outcome in outcomes]
    names = dict.fromkeys(name for row in rows for name in row if name != "command")
    text = io.StringIO()
    table = csv.DictWriter(text, [*names, "command"], restval="", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def _row(outcome: Outcome, options: Sequence[str]) -> dict[str, Any]:
    trial = outcome.trial
    row: dict[str, Any] = {"task": trial.task, "agent": trial.agent, "world": trial.world}
    row |= {"seed": trial.seed, "steps": len(outcome.path) - 1, **episode_figures(outcome)}
    row["start"] = " ".join(f"{number!r}" for number in outcome.start.tolist())
    row["begin"] = " ".join(f"{number!r}" for number in outcome.begin.tolist())
    for name in sorted(outcome.info):
        value = outcome.info[name]
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, bool | int | float | str) and name not in (*row, *_TOLD):
            row[name] = value
    return row | {"command": watch_command(trial, options)}


def watch_command(trial: Trial, options: Sequence[str] = ()) -> str:
    """Return the command that shows an episode again; empty if its settings cannot be told.

    Args:
        trial: The episode.
        options: Further options.
    """
    settings, spec = trial.settings, gymnasium.spec(trial.task)
    words = ["albot", "play", short_name(trial.task), "--agent", trial.agent]
    words += ["--world", trial.world, "--seed", str(trial.seed)]
    if not isinstance(settings.get("robot", ""), str):
        return ""
    names = ("robot", "mapper", "odometer", "laser", "sonar", "scenes", "compass", "faults")
    for name in (*names, "saved_map"):
        if name in settings:
            words += [f"--{name.replace('_', '-')}", str(settings[name])]
    outing = getattr(settings.get("config"), "outing", None)
    changed = outing is not None and outing.away != type(outing)().away
    if changed and "--config" not in options:
        return ""
    if outing is not None and outing != type(outing)():
        lengths = outing.shortest, outing.longest
        words += ["--outward", "..".join(np.format_float_positional(m, trim="-") for m in lengths)]
    steps = settings.get("max_episode_steps", spec.max_episode_steps)
    return shlex.join([*words, "--steps", str(steps), *options])
