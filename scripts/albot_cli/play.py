"""`albot play`: watch an agent at a task, or play an episode back."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from albot_cli import completion
from albot_cli.config import config_option, read_task_config
from albot_cli.count_type import CountType
from albot_cli.evaluate import recall_text, way_out
from albot_cli.mappers import mapper_config_option, read_robots_config
from albot_cli.outputs import (
    FORCE,
    JSON,
    FigureFile,
    check_file,
    check_png,
    check_suffix,
    figure_options,
    save_both,
)
from albot_cli.path_type import PathType
from albot_cli.robots import robot_option
from albot_core.counts import many
from albot_core.errors import InputError
from albot_env.rendering.frame import Frame, lengths_text

if TYPE_CHECKING:
    from albot_agents.registry import AgentEntry
    from albot_cli.episodes import PlayedEpisode

AGENTS = {
    "Albot/Explore-v0": "gap-explorer",
    "Albot/Homing-v0": "albot1-homing",
    "Albot/HomingByMap-v0": "patch-homing",
    "Albot/ExploreAndHome-v1": "round-trip",
    "Albot/PlaceRecognition-v0": "place-judge",
}
"""The default agent of each task."""
PROBED = "albot1-homing"
"""The default agent of the probes."""
SUFFIX = ".mcap"
"""Suffix of episodes, which distinguishes them from tasks here, and from logs in `albot map`."""
PRESETS = ("robot", "laser", "odometer", "sonar", "scenes")
"""Options that select the robot or a sensor by name, named like the environment's arguments."""
RUN_ONLY = (
    "world",
    "mapper",
    "mapper_config",
    "config",
    "agent",
    "seed",
    "steps",
    "outward",
    "record",
    "no_movables",
    *PRESETS,
)
"""Options that are not allowed for a recorded episode, because it fixes them."""


@click.command()
@click.argument(
    "what", required=False, metavar="[TASK|EPISODE]", shell_complete=completion.tasks_or_files
)
@click.option(
    "--world",
    shell_complete=completion.world_names,
    help="World: a name, a file or random:KIND:SEED.  [default: office-ring, or a probe's own]",
)
@click.option(
    "--mapper",
    shell_complete=completion.robots_mapper_names,
    help="See `albot mappers`; or none.  [default: the agent's own]",
)
@mapper_config_option
@config_option
@click.option(
    "--agent",
    shell_complete=completion.played_agent_names,
    help=f"{', '.join(completion.AGENTS)}, the file of a trained agent, or keyboard: you drive.  "
    "[default: "
    "gap-explorer in explore, albot1-homing in homing, patch-homing in homing-by-map, "
    "round-trip in explore-and-home, place-judge in place-recognition]",
)
@robot_option
@click.option(
    "--laser",
    shell_complete=completion.laser_names,
    help=f"{completion.listed(completion.LASERS, 'none')}.  [default: the agent's own, or lms-200]",
)
@click.option(
    "--odometer",
    shell_complete=completion.odometer_names,
    help=f"{completion.listed(completion.ODOMETERS)}.  [default: pioneer]",
)
@click.option(
    "--sonar",
    shell_complete=completion.sonar_names,
    help=f"{completion.listed(completion.SONARS, 'none')}.  [default: the agent's own, or pioneer]",
)
@click.option(
    "--scenes",
    shell_complete=completion.scene_names,
    help=f"{completion.listed(completion.SCENES, 'none')}.  [default: the agent's own, or none]",
)
@click.option(
    "--outward",
    metavar="A..B",
    help="Length of the outward journey of homing, in metres; it goes on until the way home is 5 m "
    "long.  [default: 30..100]",
)
@click.option(
    "--no-movables", is_flag=True, help="Leave out the doors, boxes and people that worlds have."
)
@click.option("--seed", default=1, show_default=True, type=CountType(min=0))
@click.option(
    "--steps",
    default=3000,
    show_default=True,
    type=CountType(min=1),
    help="Largest number of steps: of 0.1 s, or in place-recognition from stop to stop.",
)
@click.option(
    "--record",
    type=PathType(dir_okay=False),
    help="Where the episode is written.  [default: episode.mcap, or the first of episode-1.mcap, "
    "episode-2.mcap, … that is free]",
)
@click.option(
    "--png",
    type=PathType(dir_okay=False),
    help="Where the picture of truth and map is written.  [default: episode.png, or the first free "
    "one as above; none for EPISODE]",
)
@click.option(
    "--html",
    type=PathType(dir_okay=False),
    help="Also write a page that plays the episode: one file that any browser opens.",
)
@figure_options("truth and map")
@FORCE
@click.option(
    "--speed",
    type=click.FloatRange(min=0, min_open=True),
    help="How many times faster than real time it is shown.  [default: 10; 1 for keyboard]",
)
@click.option("--headless", is_flag=True, help="Show nothing but the progress line.")
@JSON
@click.pass_context
def command(
    ctx: click.Context,
    /,
    what: str | None,
    record: Path | None,
    png: Path | None,
    html: Path | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Watch an agent at TASK: explore, homing, homing-by-map, explore-and-home, place-recognition.

    Or play back the recorded EPISODE, a file. Keys pause, step and change the speed, and seek in
    a recorded episode; a line below the picture names them. The last picture stays until q.
    """
    options["headless"] = options["headless"] or as_json
    if options["speed"] is not None and isnan(options["speed"]):
        raise InputError("--speed", "a number above 0", "nan")
    episode = _episode_file(what)
    if html is not None:
        check_suffix(html, ".html", option="--html")
        check_file(html, force=force)
    if episode is None:
        record, png = _free_names(record, png)
        check_suffix(record, SUFFIX, option="--record")
        _check_picture(png, record, force)
        check_file(record, force=force)
        summary = _run(what, record=record, png=png, figure=figure, force=force, **options)
    else:
        if png is not None:
            _check_picture(png, episode, force)
        _check_play_back(ctx)
        summary = _play_back(episode, png, figure, options["speed"] or 10.0, options["headless"])
    if html is not None:
        from albot_env.rendering.page import write_page

        write_page(Path(summary["files"]["episode"]), html)
        summary["files"]["page"] = str(html)
    click.echo(json.dumps(summary) if as_json else _as_text(summary))


def _episode_file(what: str | None) -> Path | None:
    """Return the file to play back; None for a task or no argument."""
    if what is None or not (what.endswith(SUFFIX) or Path(what).is_file()):
        return None
    return Path(what)


def _check_play_back(ctx: click.Context) -> None:
    """Raise InputError if an option was given that a recorded episode fixes."""
    for name in RUN_ONLY:
        if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = f"--{name.replace('_', '-')}"
            raise InputError(option, "no such option when an episode is played back")


def _free_names(record: Path | None, png: Path | None) -> tuple[Path, Path]:
    """Return the paths of episode and picture; those not given get free names with one number."""
    for number in count():
        stem = f"episode-{number}" if number else "episode"
        ours = [Path(f"{stem}.mcap")] if record is None else []
        ours += [Path(f"{stem}.png")] if png is None else []
        if not any(os.path.lexists(path) for path in ours):
            return record or Path(f"{stem}.mcap"), png or Path(f"{stem}.png")
    raise AssertionError


def _check_picture(png: Path, episode: Path, force: bool) -> None:
    """Raise InputError if the picture cannot be written, or would overwrite the episode."""
    if png.resolve() == episode.resolve():
        raise InputError("--png", "a file other than the episode", str(png))
    check_png(png, force=force)


def _run(
    task: str | None,
    *,
    world: str | None,
    mapper: str | None,
    mapper_config: Path | None,
    config: Path | None,
    agent: str | None,
    seed: int,
    steps: int,
    record: Path,
    png: Path,
    figure: FigureFile | None,
    force: bool,
    speed: float | None,
    headless: bool,
    no_movables: bool,
    outward: str | None,
    **presets: str | None,
) -> dict[str, Any]:
    """Run an episode and return its summary. `presets` holds the options of `PRESETS`."""
    import gymnasium

    from albot_agents.agent import EnvironmentConfigs
    from albot_agents.evaluation.summary import place_figures
    from albot_agents.task import own_world
    from albot_cli.episodes import RunningEpisode
    from albot_cli.keyboard import Keyboard, enter_meaning
    from albot_cli.watch import keys_expected, open_viewer, watch
    from albot_env.recording.writer import EpisodeWriter
    from albot_env.rendering.controls import Controls
    from albot_env.tasks.core.single import SingleEnv

    task, agent, entry = _choose(task, agent)
    world = world or own_world(task) or "office-ring"
    if agent == Keyboard.name and headless:
        raise InputError("--agent keyboard", "a window or a terminal", "--headless or --json")
    if agent == Keyboard.name and not keys_expected():
        raise InputError("--agent keyboard", "a window or a terminal with keys", "neither")
    asked = {"world": world, "movables": not no_movables, "mapper": mapper, **presets}
    settings = _settings(task, entry, asked, config, mapper_config, outward)
    env = gymnasium.make(task, max_episode_steps=steps, disable_env_checker=True, **settings)
    driver = entry.make(EnvironmentConfigs.of(env))
    inside = env.unwrapped
    assert isinstance(inside, SingleEnv)
    inside.spec = env.spec  # With the time limit, which the episode's file then holds.
    inside.agent, inside.recorder = agent, EpisodeWriter(record, overwrite=force)
    drives = isinstance(driver, Keyboard)
    more = f"arrows drive · {enter_meaning(task)}" if drives else ""
    controls = Controls(speed or (1.0 if drives else 10.0), recorded=False, more=more)
    try:
        episode = RunningEpisode(env, driver, seed, steps=steps)
        title = f"{agent} in {world}"

        def keep() -> None:
            """Write the files before the last picture is shown, which may stay for long."""
            inside.recorder.close()
            _save_picture(episode.frame, png, figure)

        with (
            _report_partial_recording(record),
            open_viewer(title, episode.steps, headless=headless) as (viewer, update),
        ):
            if isinstance(driver, Keyboard):
                driver.listen(viewer)
            watch(episode, viewer, controls, update=update, at_end=keep)
        info = episode.info
        return {
            **_summary(episode),
            "world": world,
            "seed": seed,
            "files": _files(record, png, figure),
            "coverage": info.get("coverage"),
            "rooms_entered": info.get("rooms_entered"),
            "success": info.get("is_success"),
            **place_figures([info]),
        }
    finally:
        env.close()


def _settings(
    task: str,
    entry: AgentEntry,
    asked: dict[str, Any],
    config: Path | None,
    mapper_config: Path | None,
    outward: str | None,
) -> dict[str, Any]:
    """Return the settings of the environment; `asked` are those of options, None if not given."""
    settings = {name: value for name, value in asked.items() if value is not None}
    if config is not None:
        settings["config"] = read_task_config(task, config)
    if outward is not None:
        settings["config"] = way_out(task, outward, settings.get("config"))
    settings = entry.environment(task, settings)
    if mapper_config is not None:
        mapper = settings.get("mapper", entry.mapper)
        settings["mapper_config"] = read_robots_config(mapper, mapper_config)
    return settings


def _choose(task: str | None, agent: str | None) -> tuple[str, str, AgentEntry]:
    """Return the id of a task, and the name and entry of its agent.

    Raises:
        InputError: There is no such task or agent, or the agent is not for the task.
    """
    from albot_agents.registry import agent_names, find_agent
    from albot_agents.task import find_task, is_probe, untwinned
    from albot_cli.keyboard import KEYBOARD, Keyboard

    task = None if task is None else find_task(task)
    if agent is None:
        agent = PROBED if task and is_probe(task) else AGENTS[untwinned(task or next(iter(AGENTS)))]
    entry = KEYBOARD if agent == Keyboard.name else find_agent(agent)
    task = task or entry.tasks[0]
    if not entry.attempts(task):
        names = (*agent_names(task), *([Keyboard.name] if KEYBOARD.attempts(task) else []))
        found = f"{agent}, which is for {' and '.join(entry.tasks)}"
        raise InputError("--agent", f"one for {task}: {', '.join(names)}", found)
    return task, agent, entry


@contextmanager
def _report_partial_recording(record: Path) -> Iterator[None]:
    """Print which file holds the episode if Ctrl-C ends it."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"albot: {record} holds the episode up to here", err=True)
        raise


def _play_back(
    episode: Path, png: Path | None, figure: FigureFile | None, speed: float, headless: bool
) -> dict[str, Any]:
    """Play an episode back and return its summary."""
    from albot_cli.episodes import RecordedEpisode
    from albot_cli.watch import open_viewer, watch
    from albot_env.rendering.controls import Controls

    recorded = RecordedEpisode(episode, seekable=not headless)
    reader = recorded.reader
    controls = Controls(speed, recorded=True)
    with open_viewer(f"{episode}", recorded.steps, headless=headless) as (viewer, update):
        watch(recorded, viewer, controls, update=update)
    if reader.torn:
        warning = f"{episode}: never closed, ends early; played up to its last complete chunk"
        click.echo(f"albot: {warning}, at {recorded.time:.1f} s", err=True)
    if png is not None or figure is not None:
        _save_picture(recorded.frame, png, figure)
    return {
        **_summary(recorded),
        "seed": reader.header.seed,
        "files": _files(episode, png, figure),
        "coverage": None,
        "rooms_entered": len(recorded.rooms),
        "success": None,
        **dict.fromkeys(("precision", "recall", "revisits")),
        "torn": reader.torn,
    }


def _summary(episode: PlayedEpisode) -> dict[str, Any]:
    """Return the summary of an episode, from its last frame."""
    frame = episode.frame
    return {
        "task": frame.environment,
        "world": frame.world,
        "agent": frame.agent,
        "mapper": frame.mapper,
        "steps": episode.step,
        "path_m": frame.path_length,
        "driven_m": frame.driven,
        "way_out_m": frame.way_out_length,
        "updates": frame.updates,
        "surfaces": len(frame.snapshot.segments),
        "position_error_m": frame.position_error,
        "simulated_s": frame.time,
        "reward": sum(frame.terms.values()),
        "steps_in_contact": episode.contacts,
    }


def _files(episode: Path, png: Path | None, figure: FigureFile | None) -> dict[str, str | None]:
    """Return the paths by kind of file, with that of a figure only if it was asked for."""
    files = {"episode": str(episode), "picture": None if png is None else str(png)}
    return files if figure is None else {**files, "figure": str(figure.path)}


def _save_picture(frame: Frame, png: Path | None, figure: FigureFile | None) -> None:
    """Save the picture; matplotlib is loaded only here."""
    from albot_env.rendering.picture import episode_figure

    save_both(episode_figure(frame), png, figure)


def _as_text(summary: dict[str, Any]) -> str:
    """Return the summary as text."""
    rooms, covered, success = (summary[key] for key in ("rooms_entered", "coverage", "success"))
    figures = [
        lengths_text(summary["driven_m"], summary["way_out_m"]),
        many(summary["updates"], "update"),
        *([many(summary["surfaces"], "surface")] if summary["surfaces"] else []),
        f"{summary['position_error_m']:.2f} m off",
        *([] if rooms is None else [f"{many(rooms, 'room')} entered"]),
        *([] if covered is None else [f"{covered:.0%} of the ground covered"]),
        f"reward {summary['reward']:.2f}",
        *([] if summary["revisits"] is None else [recall_text(summary)]),
        *([] if success is None else ["a success" if success else "no success"]),
    ]
    lines = [
        f"{summary['agent']} at {summary['task']} in {summary['world']} with {summary['mapper']}, "
        f"seed {summary['seed']}, {many(summary['steps'], 'step')}, "
        f"{summary['simulated_s']:.0f} s:",
        f"  {' · '.join(figures)}",
        f"  episode  {summary['files']['episode']}  (albot play FILE, or open it in Foxglove)",
    ]
    drawn = {kind: summary["files"].get(kind) for kind in ("picture", "figure", "page")}
    lines += [f"  {kind:<7}  {path}" for kind, path in drawn.items() if path]
    return "\n".join(lines)
