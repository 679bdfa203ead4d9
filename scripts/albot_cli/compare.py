"""`albot compare`: mappers side by side on the same readings."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from albot_cli import completion
from albot_cli.bag_options import bag_options
from albot_cli.engine_options import engine_options
from albot_cli.mappers import read_mapper_config
from albot_cli.number_types import CountType
from albot_cli.outputs import (
    FORCE,
    JSON,
    FigureFile,
    check_file,
    check_folder,
    check_suffix,
    figure_options,
)
from albot_cli.path_type import PathType
from albot_cli.robots import robot_option
from albot_cli.signals import STOPPED
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_agents.engine.engine import Engine
    from albot_cli.mapper_runs import MapperChoice, RunResult, Source
    from albot_core.geometry.types import Segments
    from albot_core.logs.ros_bag import BagTopics

_FILE = PathType()
_WORLDS = {".yaml", ".yml", ".xml", ".world"}
"""File endings of worlds. A JSON file is a log."""
_WRITING = {"out", "html", "figure", "dpi", "force", "as_json"}
"""Options that say what is written and how."""


@click.command()
@click.argument("source", metavar="LOG|EPISODE|WORLD", shell_complete=completion.world_names)
@click.option(
    "--mappers",
    metavar="A,B,…",
    shell_complete=completion.mapper_list,
    help="Mappers to run (see `albot mappers`); NAME=FILE takes parameters from a YAML file.  "
    "[default: all that are installed and whose sensors the source has]",
)
@click.option(
    "--seeds",
    default="0",
    show_default=True,
    metavar="A..B",
    help="Seeds, both ends included: of mappers with random numbers and of episodes in a WORLD. "
    "With random:KIND, each seed is a world.",
)
@click.option("--reference", type=_FILE, help="True poses of the robot (see `albot map`).")
@click.option("--relations", type=_FILE, help="True relations between poses (Kümmerle et al.).")
@click.option("--keep-going", is_flag=True, help="Leave out the damaged lines of a log.")
@bag_options
@click.option(
    "--agent",
    default="gap-explorer",
    shell_complete=completion.agent_names,
    show_default=True,
    help="Agent that explores a WORLD without a map.",
)
@click.option(
    "--steps",
    default=6000,
    show_default=True,
    type=CountType(1),
    help="Length of the exploration, in steps of 0.1 s.",
)
@click.option(
    "--laser",
    shell_complete=completion.laser_names,
    help="Laser of the exploring robot (see `albot play`).  [default: lms-200]",
)
@click.option(
    "--sonar",
    shell_complete=completion.sonar_names,
    help="Sonars of the exploring robot.  [default: pioneer]",
)
@click.option(
    "--scenes",
    shell_complete=completion.scene_names,
    help="Camera of the exploring robot.  [default: none]",
)
@click.option(
    "--compass",
    shell_complete=completion.compass_names,
    help="Compass of the exploring robot.  [default: none]",
)
@click.option(
    "--odometer",
    shell_complete=completion.odometer_names,
    help="Odometer of the exploring robot.  [default: pioneer]",
)
@robot_option
@engine_options
@click.option("--out", type=_FILE, help="Folder for the figures, their table and a picture.")
@click.option(
    "--html",
    type=PathType(dir_okay=False),
    help="Also write a page that plays the maps of the first seed side by side, over one line of "
    "time: one file that any browser opens.",
)
@figure_options("the maps side by side")
@FORCE
@JSON
@click.pass_context
def command(
    ctx: click.Context,
    /,
    source: str,
    mappers: str | None,
    seeds: str,
    reference: Path | None,
    relations: Path | None,
    keep_going: bool,
    topics: BagTopics | None,
    agent: str,
    steps: int,
    engine: Engine,
    out: Path | None,
    html: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
    **presets: str | None,
) -> int:
    """Run several mappers on the same readings, and compare their figures.

    The readings are those of a real robot's LOG, a ROS bag among them, of a recorded EPISODE, or of
    a robot that explores a WORLD (a name, a file or random:KIND:SEED). Each run has a process of
    its own; speeds are most reliable with --jobs 1. For several seeds the medians and the worst
    error are shown. The exit status is 1 if a run died, and 130 if Ctrl-C stopped the command: then
    the figures are those of the runs so far.
    """
    from albot_agents.evaluation.plan import parse_seeds
    from albot_cli.comparison_report import FILES, as_text, rows_of, write_files, write_page
    from albot_cli.map_report import left_out, notes_of

    if out is not None:
        check_folder(out, FILES, force=force, figure=figure)
    if html is not None:
        check_suffix(html, ".html", option="--html")
        check_file(html, force=force)
    numbers = parse_seeds(seeds)
    asked = None if mappers is None else _choices(mappers)
    sensors = {name: preset for name, preset in presets.items() if preset is not None}
    is_world = _is_world(source)
    chosen = [*sensors, *(name for name in ("agent", "steps") if _given(ctx, name))]
    _check_options(source, is_world, chosen, reference=reference, relations=relations)
    if is_world and topics is not None:
        raise InputError(source, "a ROS bag, as topics are given", "a world")
    if is_world:
        sources = explored_sources(source, numbers, agent, steps, sensors, engine)
    else:
        sources = recorded_sources(source, numbers, reference, relations, keep_going, topics)
    notes = notes_of(sources[0].log, sources[0].reference, reference, sources[0].relations)
    for note in notes:
        click.echo(f"albot: {sources[0].log.name}: {note}", err=True)
    choices = _fitting(asked, sources)
    results, stopped = _run(choices, sources, engine, tracks=html is not None)
    rows = rows_of(choices, results)
    facts: dict[str, Any] = {"source": source, "seeds": seeds, "jobs": engine.workers}
    facts |= {"readings": len(sources[0].log.readings), "path_m": sources[0].log.path_length}
    facts |= {"left_out": left_out(sources[0].log), "notes": notes}
    facts |= {"rows": rows, "stopped": stopped, "files": {}}
    if out is not None or figure is not None:
        write_files(out, figure, facts, results, sources)
    if html is not None:
        walls = seen_walls(source, sources[0].seed) if is_world else None
        write_page(html, facts, results, sources[0], walls, _command(ctx))
    click.echo(json.dumps(facts) if as_json else as_text(facts))
    if stopped:
        return STOPPED
    return int(any(run["error"] is not None for row in rows for run in row["runs"]))


def _check_options(
    source: str, is_world: bool, exploring: Sequence[str], **truth: Path | None
) -> None:
    """Raise InputError if an option is for the other kind of source."""
    for name, file in truth.items():
        if is_world and file is not None:
            raise InputError(f"--{name}", "a log, which does not know the truth itself", source)
    for name in exploring:
        if not is_world:
            raise InputError(f"--{name}", "a world, which a robot is to explore", source)


def _command(ctx: click.Context) -> str:
    """Return the command line again, without the options that only say what is written."""
    words = ["albot", "compare", str(ctx.params["source"])]
    for option in ctx.command.params:
        name = option.name or ""
        if isinstance(option, click.Option) and name not in _WRITING and _given(ctx, name):
            words += [option.opts[0], *([] if option.is_flag else [str(ctx.params[name])])]
    return shlex.join(words)


def _given(ctx: click.Context, name: str) -> bool:
    """Return whether an option stands on the command line."""
    return ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE


def _run(
    choices: list[MapperChoice], sources: list[Source], engine: Engine, *, tracks: bool
) -> tuple[list[RunResult], bool]:
    """Return the results of the runs, and whether Ctrl-C stopped them early."""
    from albot_cli.mapper_runs import compare_mappers

    results: list[RunResult] = []
    try:
        with closing(compare_mappers(choices, sources, engine, tracks=tracks)) as runs:
            for result in runs:
                results.append(result)  # noqa: PERF402 - results are kept if the next is stopped
    except KeyboardInterrupt:
        return results, True
    return results, False


def _choices(text: str) -> list[MapperChoice]:
    """Return the mappers that `--mappers` names.

    Raises:
        InputError: A mapper is unknown or named twice, or a file of parameters is invalid.
    """
    from albot_cli.mapper_runs import MapperChoice
    from albot_core.mappers.registry import mapper_spec

    choices: dict[str, MapperChoice] = {}
    for label in map(str.strip, text.split(",")):
        name, equals, file = label.partition("=")
        spec = mapper_spec(name)
        if equals and not file:
            raise InputError("--mappers", "NAME or NAME=FILE", label)
        config = read_mapper_config(spec, Path(file)) if file else None
        if label in choices:
            raise InputError("--mappers", "each mapper once", f"{label} twice")
        choices[label] = MapperChoice(label=label, name=name, config=config)
    return list(choices.values())


def _fitting(asked: list[MapperChoice] | None, sources: Sequence[Source]) -> list[MapperChoice]:
    """Return the requested mappers, or all whose sensors the log has.

    Raises:
        InputError: A requested mapper needs another sensor, or no mapper fits.
    """
    from albot_cli.mapper_runs import MapperChoice
    from albot_core.mappers.registry import check_sensors, installed_mappers, mapper_spec

    log = sources[0].log
    if asked is not None:
        for choice in asked:
            check_sensors(mapper_spec(choice.name), log.sensors, log.name)
        return asked
    fitting = [
        MapperChoice(label=name, name=name)
        for name in installed_mappers()
        if mapper_spec(name).sensors <= log.sensors
    ]
    if not fitting:
        raise InputError(log.name, "a sensor by which a mapper sees", "the odometer alone")
    return fitting


def _is_world(source: str) -> bool:
    from albot_maps.generators.spec import PREFIX
    from albot_maps.load import PICTURES, catalogue_names

    if source.startswith(PREFIX) or source in catalogue_names():
        return True
    path = Path(source)
    kind = Path(path.stem).suffix if path.suffix in {".gz", ".xz"} else path.suffix
    # A word without an ending that is not a file is a misspelt world name.
    return kind in {*_WORLDS, *PICTURES} or not (path.suffix or path.exists())


def seen_walls(world: str, seed: int) -> Segments:
    """Return the walls of an explored world (world frame)."""
    from albot_maps import load_world
    from albot_maps.generators.spec import seeded

    return load_world(seeded(world, seed)).walls


def explored_sources(
    world: str, seeds: range, agent: str, steps: int, sensors: dict[str, str], engine: Engine
) -> list[Source]:
    """Explore a world, or the worlds of random:KIND, and return the readings as sources.

    Args:
        world: The world's spec.
        seeds: One source is made per seed.
        agent: Name of the exploring agent.
        steps: Length of the exploration (steps of 0.1 s).
        sensors: Presets, by the names of the environments' settings.
        engine: Runs the explorations.
    """
    from albot_cli.explored_logs import Exploration, explore_all
    from albot_cli.mapper_runs import Source
    from albot_maps.generators.spec import seeded

    explorations = [
        Exploration(world=seeded(world, seed), seed=seed, agent=agent, steps=steps, sensors=sensors)
        for seed in seeds
    ]
    return [
        Source(log=log, seed=seed, reference=log.reference_trajectory)
        for seed, log in zip(seeds, explore_all(explorations, engine), strict=True)
    ]


def recorded_sources(
    source: str,
    seeds: range,
    reference: Path | None,
    relations: Path | None,
    keep_going: bool,
    topics: BagTopics | None = None,
) -> list[Source]:
    """Read a log or an episode, and return it as one source per seed.

    Args:
        source: The file.
        seeds: Seeds of the mappers' random numbers.
        reference: File of the robot's true poses, if the log has none.
        relations: File of true relations between its poses.
        keep_going: Whether to leave out the damaged lines of a log.
        topics: The topics of a ROS bag that are read.

    Raises:
        InputError: A file is damaged, or reference or relations belong to another log.
    """
    from albot_cli.map_report import check_moments, score
    from albot_cli.mapper_runs import Source
    from albot_core.evaluation.trajectory import read_relations
    from albot_core.logs.reader import read_reference
    from albot_env.recording.log import read_log_or_episode

    log = read_log_or_episode(Path(source), keep_going, topics)
    truth = log.reference_trajectory if reference is None else read_reference(reference)
    known = None if relations is None else read_relations(relations)
    odometry = score(log.odometry_trajectory, truth, known)
    check_moments(log, truth, odometry, reference, relations)
    return [Source(log=log, seed=seed, reference=truth, relations=known) for seed in seeds]
