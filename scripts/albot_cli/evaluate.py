"""`albot evaluate`: measure an agent in many episodes of a task."""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_cli import completion
from albot_cli.config import config_option, read_task_config
from albot_cli.engine_options import engine_options
from albot_cli.evaluation_text import evaluation_text
from albot_cli.faults import faults_option
from albot_cli.mappers import mapper_config_option, read_robots_config
from albot_cli.number_types import CountType
from albot_cli.outputs import (
    FORCE,
    JSON,
    FigureFile,
    check_folder,
    figure_options,
    filled_folder,
    own_folders,
)
from albot_cli.path_type import PathType
from albot_cli.robots import robot_option
from albot_cli.rows_options import (
    RESUME,
    ROWS,
    ResumableCommand,
    continued,
    rows_place,
    words_of,
)
from albot_cli.saved_map import saved_map_option
from albot_cli.signals import STOPPED
from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from albot_agents.engine.engine import Engine
    from albot_agents.engine.rows import RowsFolder
    from albot_agents.evaluation.plan import Trial
    from albot_agents.evaluation.trial import Outcome
    from albot_env.export.minari_dataset import DatasetPlace

_FILES = _FIGURES, _PICTURE, _EPISODES = "evaluation.json", "failures.png", "episodes.csv"


@click.command(cls=ResumableCommand)
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
@faults_option
@saved_map_option
@click.option(
    "--outward",
    metavar="A..B",
    help="Length of the outward journey, in metres; it goes on until the way home is 5 m long.  "
    "[default: 30..100]",
)
@click.option("--steps", type=CountType(1), help="Time limit.  [default: the task's]")
@ROWS
@RESUME
@engine_options
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
@click.option(
    "--record",
    type=PathType(file_okay=False),
    help="Folder for the episodes: the file and the page of each, and index.html, which lists "
    "them with pictures, failures first.",
)
@click.option(
    "--only",
    type=click.Choice(["failures", "successes"]),
    help="Keep only these of the recorded episodes.",
)
@figure_options("the failures")
@FORCE
@JSON
@click.pass_context
def command(
    ctx: click.Context,
    /,
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
    faults: str | None,
    saved_map: str | None,
    outward: str | None,
    steps: int | None,
    engine: Engine,
    rows: Path | None,
    resume: Path | None,
    batch: int,
    minari: str | None,
    out: Path | None,
    record: Path | None,
    only: str | None,
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
    episodes so far; it is 1 if episodes crashed, which are listed.
    """
    from albot_agents.evaluation.plan import parse_seeds, plan_trials
    from albot_agents.registry import find_agent
    from albot_agents.task import find_task, own_world
    from albot_cli.evaluation_recordings import plan_recordings, write_index
    from albot_cli.evaluation_run import open_dataset, run_trials

    task = find_task(task)
    worlds = worlds or (own_world(task) or "random:office",)
    agents = _agents(task, agent, against)
    entry = find_agent(agent)
    settings: dict[str, Any] = {"odometer": odometer}
    given = {
        "mapper": mapper,
        "robot": robot,
        "max_episode_steps": steps,
        "faults": faults,
        "saved_map": saved_map,
    }
    settings |= {name: value for name, value in given.items() if value is not None}
    settings |= _task_settings(task, config, outward)
    place = None if minari is None else _dataset_place(minari, force)
    chosen = {name: _settings(task, name, settings, mapper_config) for name in agents}
    trials = {
        name: plan_trials(task, name, worlds, parse_seeds(seeds), its)
        for name, (its, _) in chosen.items()
    }
    judges_success = _check_settings(trials, chosen)
    _check_figure(figure, task, judges_success)
    kept, resumes = rows_place(rows, resume)
    rows_folder = None if kept is None else _rows_folder(ctx, kept, trials, record, minari)
    if place is not None:
        trials[agent] = [replace(trial, keeps_transitions=True) for trial in trials[agent]]
    (its, untrained), began = chosen[agent], time.perf_counter()
    with own_folders(record, out) as keep:
        if out is not None:
            # A run that goes on may have written there what it had.
            check_folder(out, _FILES, force=force or resume is not None, figure=figure)
        recordings = plan_recordings(record, only, batch, [*trials.values()], judges_success, force)
        with open_dataset(place, force=force) as dataset:
            found = run_trials(
                [*trials.values()], engine, batch, dataset, recordings, rows_folder, resumes=resumes
            )
        keep(record)
        outcomes = found.outcomes
        facts: dict[str, Any] = {"task": task, "agent": agent}
        facts |= {"mapper": its.get("mapper", entry.mapper), "odometer": odometer}
        facts |= {"faults": faults, "saved_map": saved_map}
        facts |= {
            "mapper_config": None if mapper_config is None else str(mapper_config),
            "config": None if config is None else str(config),
            "untrained": untrained,
        }
        facts |= {"fingerprint": None if entry.file is None else entry.file.fingerprint}
        facts |= {"world_specs": worlds, "seeds": seeds, **_summary(outcomes[0])}
        facts |= {"against": against and _against(against, *chosen[against], outcomes)}
        facts |= {"seconds": time.perf_counter() - began, "stopped": found.stopped}
        facts |= {"failed": [each.facts for each in found.failed], "rows": kept and str(kept)}
        facts |= {"files": {}, "minari": None, **write_index(recordings, facts, outcomes)}
        if place is not None and dataset.size["episodes"]:
            facts["files"]["minari"] = place.load
            facts["minari"] = {**place.facts, **dataset.size}
        parameters = {"--mapper-config": mapper_config, "--config": config}
        _write(facts, outcomes, out, figure, parameters)
    more = continued(ctx, kept) if found.stopped else []
    lines = [*(each.text for each in found.failed), *more]
    click.echo(json.dumps(facts) if as_json else "\n".join([evaluation_text(facts), *lines]))
    return STOPPED if found.stopped else int(bool(found.failed))


def _rows_folder(
    ctx: click.Context,
    place: Path,
    trials: Mapping[str, list[Trial]],
    record: Path | None,
    minari: str | None,
) -> RowsFolder:
    """Return the folder of the rows, which is neither read nor made yet.

    Raises:
        InputError: There is more to be kept of the episodes than rows hold.
    """
    from albot_agents.engine.rows import Manifest, RowsFolder, files_digest
    from albot_agents.evaluation.outcome_rows import COLUMNS
    from albot_env.export.transitions import environment_spec

    for option, given in {"--record": record, "--minari": minari}.items():
        if given is not None:
            raise InputError("--rows", f"no {option}, of which rows keep nothing", str(given))
    first = {name: some[0] for name, some in trials.items()}
    keys = [f"{trial.world} {trial.seed}" for trial in next(iter(trials.values()))]
    plan = {
        "agents": {
            name: environment_spec(trial.task, {**trial.settings, "world": ""})
            for name, trial in first.items()
        },
        "episodes": hashlib.sha256("\n".join(keys).encode()).hexdigest(),
        "files": files_digest({*trials, *(key.rpartition(" ")[0] for key in keys)}),
    }
    tasks = len(keys) * len(trials)
    manifest = Manifest(command="evaluate", words=words_of(ctx), plan=plan, tasks=tasks)
    return RowsFolder(path=place, manifest=manifest, columns=COLUMNS)


def _agents(task: str, agent: str, against: str | None) -> list[str]:
    """Return the agents that run.

    Raises:
        InputError: An agent is unknown or for another task, or both are the same.
    """
    from albot_agents.registry import check_agent

    if against == agent:
        raise InputError("--against", f"an agent other than {agent}", against)
    agents = [agent] if against is None else [agent, against]
    for name in agents:
        check_agent(name, task)
    return agents


def _task_settings(task: str, config: Path | None, outward: str | None) -> dict[str, Any]:
    """Return the configuration of the task as a setting; none if it is the usual one."""
    settings = {} if config is None else {"config": read_task_config(task, config)}
    if outward is not None:
        settings["config"] = way_out(task, outward, settings.get("config"))
    return settings


def _check_settings(
    trials: Mapping[str, list[Trial]],
    chosen: Mapping[str, tuple[dict[str, Any], tuple[str, ...]]],
) -> bool:
    """Raise InputError before the work begins if an environment cannot be made, or agents differ.

    Settings that an agent was not trained with are told. Return whether the task judges success.
    """
    from albot_agents.evaluation.paired import check_same_episodes

    judges_success = False
    for name, (_, untrained) in chosen.items():
        with closing(trials[name][0].make()) as env:
            judges_success = env.get_wrapper_attr("judges_success")
        for setting in untrained:
            click.echo(f"albot: {name} was not trained with {setting}", err=True)
    check_same_episodes({name: some[0] for name, some in trials.items()})
    return judges_success


def _check_figure(figure: FigureFile | None, task: str, judges_success: bool) -> None:
    """Raise InputError if a picture of failures is asked for of a task that cannot fail."""
    if figure is not None and not judges_success:
        raise InputError("--figure", "a task that can fail, whose failures it shows", task)


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
    check_folder(place.folder)
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


def _write(
    facts: dict[str, Any],
    outcomes: list[list[Outcome]],
    out: Path | None,
    figure: FigureFile | None,
    given_files: dict[str, Path | None],
) -> None:
    """Write the folder and the figure that were asked for; add their paths to `facts`."""
    if out is None and figure is None:
        return
    drawn = _failures(facts, outcomes)
    if drawn is not None and figure is not None:
        facts["files"]["figure"] = str(figure.save(drawn))
    elif figure is not None:
        why = "no episode ended" if facts["success_rate"] is None else "no episode failed"
        click.echo(f"albot: {figure.path}: not drawn, because {why}", err=True)
    if out is not None:
        _save(out, facts, outcomes, given_files, drawn)


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
