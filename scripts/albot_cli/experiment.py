"""`albot experiment`: repeat the papers' experiments."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from albot_cli import completion
from albot_cli.engine_options import engine_options
from albot_cli.experiment_tables import report_text
from albot_cli.group import LazyGroup
from albot_cli.outputs import FORCE, JSON, FigureFile, check_file, check_folder, figure_options
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.files import make_folder, write_text
from albot_experiments.registry import (
    ABLATED,
    EXPERIMENTS,
    FIRST_SEED,
    Experiment,
    find_experiment,
)
from albot_experiments.report import (
    REPORT_FILES,
    Report,
    ablation,
    index_path,
    read_report,
    write_index,
)

if TYPE_CHECKING:
    from albot_agents.engine.engine import Engine

ALL = "all"
"""The ID that means all experiments."""


STUDIES = {
    "comparison": "Set all mappers side by side on logs and in worlds: docs/comparison.md.",
    "disturbed-logs": "Map logs under every disturbance: docs/robustness.md.",
    "example-log": "Make the small log that comes with the project.",
    "false-closures": "Add false loop closures to graph SLAM's map of a log.",
    "fault-survival": "Count the mappers that survive faults on purpose: docs/reliability.md.",
    "homing-distances": "Measure homing after journeys of 10 to 160 m: docs/homing_distances.md.",
    "kidnapped-robots": "Count the kidnapped robots that notice it.",
    "lost-evidence": "Fit the weights of hypotheses of where a kidnapped robot is.",
    "map-patches": "Draw the map that agents observe beside the mapper's map.",
    "odometer-resets": "Put resets of the odometer into logs, and map them.",
    "place-evidence": "Fit the weights of the evidence that two places are one.",
    "room-confusions": "Count the random worlds in which a room is taken for another.",
    "saved-maps": "Localise robots in saved maps: docs/saved_maps.md.",
    "scaling": "Measure what campaigns cost on many cores: docs/scaling.md.",
    "slam-growth": "Measure metric SLAM's time and memory, lap by lap.",
    "trivial-policies": "Measure what trivial policies earn in each task: docs/rewards.md.",
}


@click.group()
def command() -> None:
    """Repeat the papers' experiments and compare our figures with theirs."""


@command.group(cls=LazyGroup, package="albot_studies", summaries=STUDIES)
def study() -> None:
    """Repeat the measurements that the pages in docs/ report."""


@command.command("list")
@JSON
def list_experiments(as_json: bool) -> None:
    """List the experiments."""
    rows = [{"id": e.id, "title": e.title, "seeds": e.seeds} for e in EXPERIMENTS.values()]
    if as_json:
        click.echo(json.dumps({"experiments": rows}))
        return
    for row in rows:
        click.echo(f"{row['id']}  {row['title']}, {row['seeds']} seeds")


@command.command("run")
@click.argument("name", metavar="ID", shell_complete=completion.experiment_names)
@click.option(
    "--seeds",
    metavar="A..B",
    help=f"First and last seed. Default: from {FIRST_SEED} on, as many as the list shows.",
)
@click.option(
    "--out",
    type=PathType(),
    help="Folder for the report: Markdown, pictures, JSON. For all: one folder each, and a "
    "summary page, OUT.md.",
)
@click.option(
    "--agent",
    shell_complete=completion.agent_names,
    help="In a probe of agents: the only agent beside the oracle.",
)
@click.option(
    "--mapper",
    shell_complete=completion.robots_mapper_names,
    help="In a probe of agents: the agents' mapper.  [default: each agent's own]",
)
@click.option(
    "--odometer",
    shell_complete=completion.odometer_names,
    help="In a probe of agents: the odometer.  [default: pioneer]",
)
@engine_options
@figure_options("its picture (FILE-NAME for each of several)")
@FORCE
@JSON
def run_experiment(
    name: str,
    seeds: str | None,
    out: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
    engine: Engine,
    **options: str | None,
) -> None:
    """Run the experiment ID, or all; `albot experiment list` names them.

    Probes, whose IDs begin with probe-, repeat tests of animals and people. Most test agents, and
    run their episodes in parallel; probe-pointing, probe-jrd and probe-axes ask mappers. These and
    all other experiments run in one process.
    """
    from albot_agents.evaluation.plan import parse_seeds  # slow to load

    over = None if seeds is None else parse_seeds(seeds)
    chosen = list(EXPERIMENTS.values()) if name == ALL else [find_experiment(name)]
    _check_figure(figure, out, name, force)
    for experiment in chosen:
        experiment.check()
    if out is not None:
        check_folder(out)
        for folder in [out / each.id for each in chosen] if name == ALL else [out]:
            if folder.exists():
                check_folder(folder, REPORT_FILES, force=force)
        if name == ALL:
            check_folder(out.parent, [index_path(out).name], force=force)
    given = {option: value for option, value in options.items() if value is not None}
    if name == ALL:
        if given:
            raise InputError(f"--{next(iter(given))}", "one probe", ALL)
        _run_all(chosen, over, out, as_json, engine)
    else:
        _run_one(chosen[0], over, out, figure, as_json, engine, given)


@command.command("page")
@click.argument("folder", type=PathType())
@FORCE
def write_page(folder: Path, force: bool) -> None:
    """Write the summary page of the existing reports in FOLDER, one per experiment."""
    check_file(index_path(folder), force=force)
    reports = [read_report(folder / name) for name in EXPERIMENTS]
    click.echo(str(write_index(reports, folder)))


@command.command("ablation")
@click.argument("folder", type=PathType())
@FORCE
def write_ablation(folder: Path, force: bool) -> None:
    """Write the table that compares Albot1's mappers, from the reports in FOLDER."""
    page = folder.with_name("albot1_ablation.md")
    check_file(page, force=force)
    write_text(page, ablation([read_report(folder / name) for name in ABLATED], folder.name))
    click.echo(str(page))


def _check_figure(figure: FigureFile | None, out: Path | None, name: str, force: bool) -> None:
    """Raise InputError if the figure is of no single experiment, or not beside other files."""
    if figure is None:
        return
    if name == ALL:
        raise InputError("--figure", "one experiment", ALL)
    if out is not None and figure.path.resolve().parent == out.resolve():
        expected = "a file outside the folder of --out, whose pictures are the report's"
        raise InputError("--figure", expected, str(figure.path))
    for other in sorted(figure.path.parent.glob(figure.named("*").path.name)):
        check_file(other, force=force)


def _run_one(
    experiment: Experiment,
    seeds: range | None,
    out: Path | None,
    figure: FigureFile | None,
    as_json: bool,
    engine: Engine,
    options: dict[str, str],
) -> None:
    report = _run(experiment, seeds, engine, **options)
    files = report.write(out) if out else []
    if figure is not None:
        is_alone = len(report.pictures) == 1
        for picture, drawn in report.pictures.items():
            files.append((figure if is_alone else figure.named(picture)).save(drawn))
    if as_json:
        click.echo(json.dumps(report.as_json() | {"files": [str(path) for path in files]}))
    else:
        _print(report, files)


def _run_all(
    experiments: list[Experiment],
    seeds: range | None,
    out: Path | None,
    as_json: bool,
    engine: Engine,
) -> None:
    """Run experiments one after another; write each report as soon as it is complete."""
    reports, files = [], []
    if out:
        make_folder(out)
    for experiment in experiments:
        report = _run(experiment, seeds, engine)
        written = report.write(out / experiment.id) if out else []
        reports.append(report)
        files += written
        if not as_json:
            _print(report, written)
    if out:
        files.append(write_index(reports, out))
    if as_json:
        found = [report.as_json() for report in reports]
        click.echo(json.dumps({"experiments": found, "files": [str(path) for path in files]}))


def _run(experiment: Experiment, seeds: range | None, engine: Engine, **options: str) -> Report:
    over = experiment.default_seeds if seeds is None else seeds
    with progress(experiment.id, len(over), "seeds") as update:
        return experiment.run(over, update, engine, **options)


def _print(report: Report, files: list[Path]) -> None:
    click.echo(f"{report_text(report)}\n")
    for path in files:
        click.echo(str(path))
