"""`albot play`: watch an agent at a task, or play an episode back."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from albot_cli import completion
from albot_cli.config import config_option
from albot_cli.faults import faults_option
from albot_cli.grid_type import Grid, GridType
from albot_cli.mappers import mapper_config_option
from albot_cli.number_types import CountType, RealType
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
from albot_cli.play_report import episode_summary, episode_text, file_names
from albot_cli.play_setup import choose_agent, environment_settings
from albot_cli.robots import robot_option
from albot_cli.saved_map import saved_map_option
from albot_core.errors import InputError
from albot_env.rendering.frame import Frame

if TYPE_CHECKING:
    from albot_cli.episodes import PlayedEpisode
    from albot_cli.watch import StepCallback

SUFFIX = ".mcap"
"""Suffix of episodes, which distinguishes them from tasks here, and from logs in `albot map`."""
PRESETS = ("robot", "laser", "odometer", "sonar", "scenes", "compass", "faults", "saved_map")
"""Options that select the robot, a sensor, faults or a map by name, named like the environment's
arguments."""
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
    "grid",
    "no_movables",
    *PRESETS,
)
"""Options that are not allowed for a recorded episode, because it fixes them."""
SPEED = 10.0
"""How many times faster than real time an episode is shown, and filmed, by default."""


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
@faults_option
@saved_map_option
@click.option(
    "--compass",
    shell_complete=completion.compass_names,
    help=f"{completion.listed(completion.COMPASSES, 'none')}.  [default: the agent's own, or none]",
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
@click.option(
    "--video",
    type=PathType(dir_okay=False),
    help="Film the episode instead of showing it: .mp4 or .gif.",
)
@click.option(
    "--grid",
    type=GridType(),
    help="Run as many episodes side by side, with the seeds from --seed on, as one mosaic for "
    "--video and --png, such as 3x3; nothing is recorded. Of a world random:KIND each seed is one.",
)
@figure_options("truth and map")
@FORCE
@click.option(
    "--speed",
    type=RealType(min=0, min_open=True),
    help="How many times faster than real time it is shown, or filmed.  [default: 10; 1 for "
    "keyboard]",
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
    video: Path | None,
    grid: Grid | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Watch an agent at TASK: explore, homing, homing-by-map, explore-and-home, place-recognition.

    Or play back the recorded EPISODE, a file. Keys pause, step and change the speed, and seek in
    a recorded episode; a line below the picture names them. The last picture stays until q.
    """
    options["headless"] = options["headless"] or as_json or video is not None
    _check_video(video, force)
    episode = _episode_file(what)
    if html is not None:
        check_suffix(html, ".html", option="--html")
        check_file(html, force=force)
    if episode is not None:
        _check_others(html, video, figure, episode)
        if png is not None:
            _check_picture(png, episode, force)
        _check_play_back(ctx)
        speed, headless = options["speed"] or SPEED, options["headless"]
        summary = _play_back(episode, png, figure, video, speed, headless)
    elif grid is not None:
        _check_grid(record, html, figure)
        png = _free_names(record, png)[1] if video is None else png
        check_png(png, force=force)
        summary = _run_grid(what, grid, png=png, video=video, **options)
    else:
        record, png = _free_names(record, png)
        check_suffix(record, SUFFIX, option="--record")
        _check_picture(png, record, force)
        check_file(record, force=force)
        files: dict[str, Any] = {"record": record, "png": png, "figure": figure, "video": video}
        summary = _run(what, force=force, **files, **options)
    if html is not None:
        from albot_env.rendering.page import write_page

        write_page(Path(summary["files"]["episode"]), html)
        summary["files"]["page"] = str(html)
    as_text = episode_text if grid is None else _grid_text
    click.echo(json.dumps(summary) if as_json else as_text(summary))


def _check_video(video: Path | None, force: bool) -> None:
    """Raise InputError if there is a video that cannot be made or written."""
    if video is not None:
        from albot_cli.film import check_video

        check_video(video, force=force)


def _check_grid(record: Path | None, html: Path | None, figure: FigureFile | None) -> None:
    """Raise InputError if an option was given that is for one episode alone."""
    alone = {"--record": record, "--html": html, "--figure": figure and figure.path}
    for option, value in alone.items():
        if value is not None:
            raise InputError(option, "no such option with --grid", str(value))


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


def _check_others(
    html: Path | None, video: Path | None, figure: FigureFile | None, episode: Path
) -> None:
    """Raise InputError if one of the files would overwrite the episode."""
    written = {"--html": html, "--video": video, "--figure": figure.path if figure else None}
    for option, path in written.items():
        if path is not None:
            _check_other(option, path, episode)


def _check_other(option: str, path: Path, episode: Path) -> None:
    """Raise InputError if a file would overwrite the episode."""
    if path.resolve() == episode.resolve():
        raise InputError(option, "a file other than the episode", str(path))


def _check_picture(png: Path, episode: Path, force: bool) -> None:
    """Raise InputError if the picture cannot be written, or would overwrite the episode."""
    _check_other("--png", png, episode)
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
    video: Path | None,
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

    task, agent, entry = choose_agent(task, agent)
    world = world or own_world(task) or "office-ring"
    if agent == Keyboard.name and headless:
        found = "--headless or --json" if video is None else "--video"
        raise InputError("--agent keyboard", "a window or a terminal", found)
    if agent == Keyboard.name and not keys_expected():
        raise InputError("--agent keyboard", "a window or a terminal with keys", "neither")
    asked = {"world": world, "movables": not no_movables, "mapper": mapper, **presets}
    settings = environment_settings(task, entry, asked, config, mapper_config, outward)
    env = gymnasium.make(task, max_episode_steps=steps, disable_env_checker=True, **settings)
    driver = entry.make(EnvironmentConfigs.of(env))
    inside = env.unwrapped
    assert isinstance(inside, SingleEnv)
    inside.spec = env.spec  # With the time limit, which the episode's file then holds.
    inside.agent, inside.recorder = agent, EpisodeWriter(record, overwrite=force)
    drives = isinstance(driver, Keyboard)
    more = f"arrows drive · {enter_meaning(task)}" if drives else ""
    controls = Controls(speed or (1.0 if drives else SPEED), recorded=False, more=more)
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
            if video is not None:
                _film(episode, video, controls.speed, update)
            watch(episode, viewer, controls, update=update, at_end=keep)
        info = episode.info
        return {
            **episode_summary(episode),
            "world": world,
            "seed": seed,
            "files": file_names(record, png, figure, video),
            "coverage": info.get("coverage"),
            "rooms_entered": info.get("rooms_entered"),
            "success": info.get("is_success"),
            **place_figures([info]),
        }
    finally:
        env.close()


def _film(episode: PlayedEpisode, video: Path, speed: float, update: StepCallback) -> None:
    """Film an episode to its end."""
    from albot_cli.film import film
    from albot_env.rendering.video import open_video
    from albot_env.tasks.core.follower import painted

    with open_video(video) as writer:
        capture = lambda: partial(painted, episode.frame)  # noqa: E731
        film(episode, writer, capture, speed=speed, update=update)


def _run_grid(
    task: str | None,
    grid: Grid,
    *,
    world: str | None,
    mapper: str | None,
    mapper_config: Path | None,
    config: Path | None,
    agent: str | None,
    seed: int,
    steps: int,
    png: Path | None,
    video: Path | None,
    speed: float | None,
    headless: bool,
    no_movables: bool,
    outward: str | None,
    **presets: str | None,
) -> dict[str, Any]:
    """Run several episodes side by side; return their summary."""
    from albot_agents.task import own_world
    from albot_cli.keyboard import Keyboard
    from albot_cli.play_grid import play_grid

    task, agent, entry = choose_agent(task, agent)
    if agent == Keyboard.name:
        raise InputError("--agent keyboard", "one episode", f"--grid {grid.columns}x{grid.rows}")
    world = world or own_world(task) or "office-ring"
    asked = {"world": world, "movables": not no_movables, "mapper": mapper, **presets}
    settings = environment_settings(task, entry, asked, config, mapper_config, outward)
    return play_grid(
        task,
        agent,
        entry,
        settings,
        grid,
        seed=seed,
        steps=steps,
        png=png,
        video=video,
        speed=speed or SPEED,
    )


def _grid_text(summary: dict[str, Any]) -> str:
    from albot_cli.play_grid import grid_text

    return grid_text(summary)


@contextmanager
def _report_partial_recording(record: Path) -> Iterator[None]:
    """Print which file holds the episode if Ctrl-C ends it."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"albot: {record} holds the episode up to here", err=True)
        raise


def _play_back(
    episode: Path,
    png: Path | None,
    figure: FigureFile | None,
    video: Path | None,
    speed: float,
    headless: bool,
) -> dict[str, Any]:
    """Play an episode back and return its summary."""
    from albot_cli.episodes import RecordedEpisode
    from albot_cli.watch import open_viewer, watch
    from albot_env.rendering.controls import Controls

    recorded = RecordedEpisode(episode, seekable=not headless)
    reader = recorded.reader
    controls = Controls(speed, recorded=True)
    with open_viewer(f"{episode}", recorded.steps, headless=headless) as (viewer, update):
        if video is not None:
            _film(recorded, video, speed, update)
        watch(recorded, viewer, controls, update=update)
    if reader.torn:
        warning = f"{episode}: never closed, ends early; played up to its last complete chunk"
        click.echo(f"albot: {warning}, at {recorded.time:.1f} s", err=True)
    if png is not None or figure is not None:
        _save_picture(recorded.frame, png, figure)
    return {
        **episode_summary(recorded),
        "seed": reader.header.seed,
        "files": file_names(episode, png, figure, video),
        "coverage": None,
        "rooms_entered": len(recorded.rooms),
        "success": None,
        **dict.fromkeys(("precision", "recall", "revisits")),
        "torn": reader.torn,
    }


def _save_picture(frame: Frame, png: Path | None, figure: FigureFile | None) -> None:
    """Save the picture; matplotlib is loaded only here."""
    from albot_env.rendering.picture import episode_figure

    save_both(episode_figure(frame), png, figure)
