"""`albot evaluate`: measure an agent in many episodes of a task."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_cli import completion
from albot_cli.config import config_option, read_task_config
from albot_cli.count_type import CountType
from albot_cli.mappers import mapper_config_option, read_robots_config
from albot_cli.outputs import FORCE, JSON, FigureFile, check_folder, figure_options, filled_folder
from albot_cli.path_type import PathType
from albot_cli.robots import robot_option
from albot_cli.signals import STOPPED
from albot_core.counts import many
from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from albot_agents.evaluation.plan import Trial
    from albot_agents.evaluation.trial import Outcome
    from albot_env.export.minari_dataset import DatasetPlace

_FIGURES, _PICTURE, _EPISODES = "evaluation.json", "failures.png", "episodes.csv"


@click.command()
@click.argument("task", shell_complete=completion.task_names)
@click.option(
    "--agent",
    required=True,
    shell_complete=completion.agent_names,
    help="See `albot agents list`.",
)
@click.option(
    "--worlds",
    multiple=True,
    metavar="SPEC",
    shell_complete=completion.world_names,
    help="random:KIND (each seed is a world), a name, a file, or a pattern of files; repeatable.  "
    "[default: random:office, or a probe's own]",
)
@click.option(
    "--seeds", default="1000..1019", show_default=True, metavar="A..B", help="Both included."
)
@click.option(
    "--against",
    metavar="AGENT",
    shell_complete=completion.agent_names,
    help="Run this agent through the same episodes, too, and tell the differences.",
)
@click.option(
    "--mapper",
    shell_complete=completion.robots_mapper_names,
    help="See `albot mappers`; or none.  [default: the agent's own]",
)
@mapper_config_option
@config_option
@robot_option
@click.option(
    "--odometer",
    "--noise",
    default="pioneer",
    show_default=True,
    shell_complete=completion.odometer_names,
    help=f"{completion.listed(completion.ODOMETERS)}.",
)
@click.option(
    "--outward",
    metavar="A..B",
    help="Length of the outward journey, in metres; it goes on until the way home is 5 m long.  "
    "[default: 30..100]",
)
@click.option("--steps", type=CountType(1), help="Time limit.  [default: the task's]")
@click.option("--jobs", type=CountType(1), help="Processes.  [default: one a core]")
@click.option(
    "--batch",
    type=CountType(1, 4096),
    default=1,
    show_default=True,
    help="Episodes that a process steps together. They are the same; trained agents are faster.",
)
@click.option(
    "--minari",
    metavar="ID",
    help="Also keep the episodes of --agent as a Minari data set, for offline reinforcement "
    "learning: an id (`albot/homing-v0`) or a folder.",
)
@click.option(
    "--out",
    type=PathType(file_okay=False),
    help="Folder for evaluation.json, episodes.csv (a row an episode) and, of tasks that can "
    "succeed, a picture of the failures if there are any.",
)
@figure_options("the failures")
@FORCE
@JSON
def command(
    task: str,
    agent: str,
    worlds: tuple[str, ...],
    seeds: str,
    against: str | None,
    mapper: str | None,
    mapper_config: Path | None,
    config: Path | None,
    robot: str | None,
    odometer: str,
    outward: str | None,
    steps: int | None,
    jobs: int | None,
    batch: int,
    minari: str | None,
    out: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> int:
    """Run an agent through many episodes of TASK, such as homing (or Albot/Homing-v0).

    The figures are: success with its 95 % Wilson interval, success weighted by path length (SPL,
    mean and median, with bootstrapped 95 % intervals), and the final distance from home. World,
    start, outward journey, tour, boxes and people of an episode depend on its world and seed alone,
    so that agents can be compared episode by episode (--against). --mapper and its parameters are
    for both agents. If Ctrl-C stops it, the exit status is 130 and the figures are those of the
    episodes so far.
    """
    from albot_agents.evaluation.plan import parse_seeds, plan_trials
    from albot_agents.registry import check_agent, find_agent
    from albot_agents.task import find_task, own_world
    from albot_cli.evaluation_run import open_dataset, run_trials

    task = find_task(task)
    worlds = worlds or (own_world(task) or "random:office",)
    agents = [agent] if against is None else [agent, against]
    if against == agent:
        raise InputError("--against", f"an agent other than {agent}", against)
    for name in agents:
        check_agent(name, task)
    entry = find_agent(agent)
    settings: dict[str, Any] = {"odometer": odometer}
    given = {"mapper": mapper, "robot": robot, "max_episode_steps": steps}
    settings |= {name: value for name, value in given.items() if value is not None}
    if config is not None:
        settings["config"] = read_task_config(task, config)
    if outward is not None:
        settings["config"] = way_out(task, outward, settings.get("config"))
    place = None if minari is None else _dataset_place(minari, force)
    if out is not None:
        check_folder(out, (_FIGURES, _PICTURE, _EPISODES), force=force)
    chosen = {name: _settings(task, name, settings, mapper_config) for name in agents}
    trials = {
        name: plan_trials(task, name, worlds, parse_seeds(seeds), its)
        for name, (its, _) in chosen.items()
    }
    _check_settings(trials, chosen)
    if place is not None:
        trials[agent] = [replace(trial, keeps_transitions=True) for trial in trials[agent]]
    its, untrained = chosen[agent]
    began = time.perf_counter()
    with open_dataset(place, force=force) as dataset:
        jobs = jobs or os.cpu_count() or 1
        outcomes, stopped = run_trials([*trials.values()], jobs, batch, dataset)
    facts: dict[str, Any] = {"task": task, "agent": agent}
    facts |= {"mapper": its.get("mapper", entry.mapper), "odometer": odometer}
    facts["mapper_config"] = None if mapper_config is None else str(mapper_config)
    facts["config"] = None if config is None else str(config)
    facts["untrained"] = untrained
    facts["fingerprint"] = None if entry.file is None else entry.file.fingerprint
    facts |= {"world_specs": worlds, "seeds": seeds, **_summary(outcomes[0])}
    facts["against"] = against and _against(against, *chosen[against], outcomes)
    facts |= {"seconds": time.perf_counter() - began, "stopped": stopped}
    facts["files"] = {} if place is None else {"minari": place.load}
    facts["minari"] = None if place is None else {**place.facts, **dataset.size}
    drawn = _failures(facts, outcomes) if out is not None or figure is not None else None
    if drawn is not None and figure is not None:
        facts["files"]["figure"] = str(figure.save(drawn))
    if out is not None:
        files = {"--mapper-config": mapper_config, "--config": config}
        _save(out, facts, outcomes, files, drawn)
    click.echo(json.dumps(facts) if as_json else _as_text(facts))
    return STOPPED if stopped else 0


def _check_settings(
    trials: Mapping[str, list[Trial]],
    chosen: Mapping[str, tuple[dict[str, Any], tuple[str, ...]]],
) -> None:
    """Raise InputError before the work begins if an environment cannot be made, or agents differ.

    Settings that an agent was not trained with are told.
    """
    from albot_agents.evaluation.paired import check_same_episodes

    for name, (_, untrained) in chosen.items():
        trials[name][0].make().close()
        for setting in untrained:
            click.echo(f"albot: {name} was not trained with {setting}", err=True)
    check_same_episodes({name: some[0] for name, some in trials.items()})


def _settings(
    task: str, agent: str, wanted: dict[str, Any], mapper_config: Path | None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the settings of an agent's environments, and those that it was not trained with."""
    from albot_agents.registry import find_agent

    entry = find_agent(agent)
    parameters = {} if mapper_config is None else {"mapper_config": mapper_config}
    settings = entry.environment(task, wanted)
    if mapper_config is not None:
        inside = settings.get("mapper", entry.mapper)
        settings["mapper_config"] = read_robots_config(inside, mapper_config)
    return settings, entry.untrained_settings(wanted | parameters)


def way_out(task: str, text: str, config: Any = None) -> Any:
    """Return a configuration of the task with an outward journey of length `A..B` (m).

    `config` is the configuration to change; None for the default.
    """
    from albot_agents.task import untwinned
    from albot_env.tasks.homing.outward_journey import LENGTHS
    from albot_env.tasks.homing.task import HomingConfig, HomingTask

    if untwinned(task) != HomingTask.environment:
        raise InputError(
            "--outward", f"{HomingTask.environment}, which has an outward journey", task
        )
    number = r"(\d+(?:\.\d+)?)"
    found = re.fullmatch(rf"{number}\.\.{number}", text)
    if found is None:
        raise InputError("--outward", "A..B in metres, as 30..100", text or "nothing")
    shortest, longest = float(found[1]), float(found[2])
    if longest < shortest:
        raise InputError("--outward", "a range A..B with B at least A", text)
    if longest not in LENGTHS:
        raise InputError("--outward", f"lengths that are {LENGTHS.expected} (m)", text)
    config = config or HomingConfig()
    outing = replace(config.outing, shortest=shortest, longest=longest)
    if shortest < outing.away:
        click.echo(
            f"albot: --outward {text}: a journey goes on until the way home is {outing.away:g} m "
            "long (`away`)",
            err=True,
        )
    return replace(config, outing=outing)


def _dataset_place(minari: str, force: bool) -> DatasetPlace:
    """Return where the data set is to be, once that is checked."""
    from albot_env.export.minari_dataset import DatasetPlace, check_place

    if not minari:
        raise InputError("--minari", "the id of the data set or its folder", "nothing")
    place = DatasetPlace.of(minari)
    check_place(place, force=force)
    return place


def _against(
    agent: str,
    settings: dict[str, Any],
    untrained: tuple[str, ...],
    outcomes: list[list[Outcome]],
) -> dict[str, Any]:
    """Return the figures of the other agent, and the differences in the same episodes."""
    from albot_agents.evaluation.paired import paired_differences
    from albot_agents.registry import find_agent

    file, figures = find_agent(agent).file, _summary(outcomes[1])
    del figures["worlds"]
    facts = {"agent": agent, "mapper": settings["mapper"], "untrained": untrained}
    facts["fingerprint"] = None if file is None else file.fingerprint
    return {**facts, **figures, "differences": paired_differences(*outcomes)}


def _summary(outcomes: list[Outcome]) -> dict[str, Any]:
    from albot_agents.evaluation.summary import summarise

    return summarise(outcomes)


def _failures(facts: dict[str, Any], outcomes: list[list[Outcome]]) -> Figure | None:
    """Return the picture of the first agent's failures; None if there are none."""
    if facts["success_rate"] is None:
        return None
    from albot_agents.evaluation.picture import failures_figure  # slow to load

    return failures_figure(outcomes[0])


def _save(
    out: Path,
    facts: dict[str, Any],
    outcomes: list[list[Outcome]],
    given_files: dict[str, Path | None],
    drawn: Figure | None,
) -> None:
    """Write the figures, the episodes and the picture; add their paths to `facts`.

    `given_files` are the files of parameters, by option.
    """
    from albot_agents.evaluation.paired import episodes_csv
    from albot_core.files import write_text

    facts["files"] |= {"figures": str(out / _FIGURES), "episodes": str(out / _EPISODES)}
    given = {option: str(path) for option, path in given_files.items() if path is not None}
    options = [word for option in given.items() for word in option]
    with filled_folder(out) as scratch:
        if drawn is not None:
            save_figure(drawn, scratch / _PICTURE)
            facts["files"]["failures"] = str(out / _PICTURE)
        else:
            (out / _PICTURE).unlink(missing_ok=True)  # It would show those of an earlier run.
        episodes = [outcome for some in outcomes for outcome in some]
        write_text(scratch / _EPISODES, episodes_csv(episodes, options))
        write_text(scratch / _FIGURES, json.dumps(facts, indent=1))


def _as_text(facts: dict[str, Any]) -> str:
    """Return the figures as text."""
    lines = [
        f"{facts['agent']} in {facts['task']}, {many(facts['episodes'], 'episode')}, mapper "
        f"{facts['mapper']}, odometer {facts['odometer']}, {facts['seconds']:.0f} s"
        + (", stopped before the end" if facts["stopped"] else "")
    ]
    if facts["success_rate"] is not None:
        low, high = facts["ci95"]
        lines.append(f"  success   {facts['success_rate']:.0%}  (95 %: {low:.0%} to {high:.0%})")
    if facts["spl"] is not None:
        spl_low, spl_high = facts["spl_ci95"]
        lines.append(
            f"  SPL       {facts['spl']:.2f}  (95 %: {spl_low:.2f} to {spl_high:.2f}), "
            f"median {facts['spl_median']:.2f}, soft {facts['soft_spl']:.2f}"
        )
    if facts["mean_final_distance_m"] is not None:
        began = facts["mean_initial_distance_m"]
        lines.append(
            f"  from home {facts['mean_final_distance_m']:.1f} m at the end"
            + ("" if began is None else f", {began:.1f} m at the beginning")
        )
    if facts["revisits"] is not None:
        lines.append(f"  places    {recall_text(facts)}")
    if facts["mean_coverage"] is not None:
        lines.append(
            f"  covered   {facts['mean_coverage']:.0%} of the ground; "
            f"{facts['collisions_per_m'] or 0:.3f} collisions a metre"
        )
    if facts["coverage_auc"] is not None:
        low, high = facts["coverage_auc_ci95"]
        far, all_of = facts["coverage_episodes"], facts["episodes"]
        lines.append(
            f"  exploring {facts['coverage_auc']:.3f} covered on average over the first 200 m  "
            f"(95 %: {low:.3f} to {high:.3f})"
            + ("" if far == all_of else f", which {far} of {many(all_of, 'episode')} drove")
        )
    elif facts["mean_coverage"] is not None:
        lines.append("  exploring nothing to average: no episode drove 200 m")
    if facts["rooms_share"] is not None:
        low, high = facts["rooms_share_ci95"]
        lines.append(
            f"  rooms     {facts['rooms_share']:.0%} entered  (95 %: {low:.0%} to {high:.0%})"
        )
    if facts["against"] is not None:
        lines += _differences(facts["against"])
    lines += [f"  {name:<9} {path}" for name, path in facts["files"].items()]
    return "\n".join(lines)


def recall_text(facts: Mapping[str, Any]) -> str:
    """Return recall and precision of place recognition as text."""
    recall, precision = (
        "–" if facts[name] is None else f"{facts[name]:.3f}" for name in ("recall", "precision")
    )
    if not facts["revisits"]:
        claims = "" if facts["precision"] is None else f"; precision {precision}"
        return f"no recall: no place was seen again{claims}"
    return f"recall {recall} at precision {precision}, of {facts['revisits']} seen again"


def _differences(against: dict[str, Any]) -> list[str]:
    """Return the differences from the other agent as lines of text."""
    from albot_agents.evaluation.paired import FIGURES

    lines = [f"  less {against['agent']}, mapper {against['mapper']}, in the same episodes:"]
    for name, found in against["differences"].items():
        low, high = found["ci95"]
        lines.append(
            f"    {FIGURES[name]:<19}{found['mean']:+.3f}  (95 %: {low:+.3f} to {high:+.3f}); "
            f"larger in {found['larger']}, smaller in {found['smaller']}, "
            f"equal in {found['equal']}"
        )
    return lines
