"""`albot play`: watch a robot explore and map, or play an episode back."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from albot_cli.mappers import read_mapper_config
from albot_cli.outputs import check_file, check_png
from albot_core.errors import InputError
from albot_core.mappers.registry import mapper_spec
from albot_env.rendering.frame import Frame

if TYPE_CHECKING:
    import gymnasium

    from albot_agents.agent import Agent
    from albot_cli.live_view import LiveView
    from albot_env.tasks.explore.env import ExploreEnv

SENSORS = ("laser", "odometer", "sonar", "scenes")
"""Options that choose a sensor's preset, named as the environment's arguments."""
RUN_ONLY = (
    "world",
    "mapper",
    "mapper_config",
    "agent",
    "seed",
    "steps",
    "record",
    "no_movables",
    *SENSORS,
)
"""Options that a recorded episode has already decided."""


@click.command()
@click.argument("episode", required=False, type=click.Path(path_type=Path))
@click.option(
    "--world",
    default="office-ring",
    show_default=True,
    help="World: a name, a file or random:KIND:SEED.",
)
@click.option("--mapper", default="albot1", show_default=True, help="See `albot mappers`.")
@click.option(
    "--mapper-config",
    type=click.Path(path_type=Path, dir_okay=False),
    help="YAML file of the mapper's thresholds that differ from its default ones.",
)
@click.option(
    "--agent",
    default="gap-explorer",
    show_default=True,
    help="albot1-homing, exploring, gap-explorer, nearest-frontier, oracle, path-integration, "
    "random, or the file of a trained agent.",
)
@click.option(
    "--laser",
    default="lms-200",
    show_default=True,
    help="ideal, lms-200, lms-200-fine, long or short.",
)
@click.option(
    "--odometer",
    default="pioneer",
    show_default=True,
    help="ideal, pioneer, poor, carpet, stage, albot1-disturbed, bias-1.5, bias-3 or bias-6.",
)
@click.option("--sonar", default="pioneer", show_default=True, help="ideal, pioneer, poor or none.")
@click.option(
    "--scenes", default="none", show_default=True, help="ideal, paper, ambiguous or none."
)
@click.option(
    "--no-movables", is_flag=True, help="Leave out the doors, boxes and people that worlds have."
)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0))
@click.option(
    "--steps",
    default=3000,
    show_default=True,
    type=click.IntRange(min=1),
    help="Length, in steps of 0.1 s.",
)
@click.option(
    "--record",
    default="episode.mcap",
    show_default=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where the episode is written.",
)
@click.option(
    "--png",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where the picture of truth and map is written.  [default: episode.png; none for EPISODE]",
)
@click.option(
    "--speed",
    default=10.0,
    show_default=True,
    type=click.FloatRange(min=0, min_open=True),
    help="How many times faster than real time it is shown.",
)
@click.option("--headless", is_flag=True, help="Show nothing but the progress line.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, show nothing.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    episode: Path | None,
    png: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Watch a robot explore and map, or play back the recorded EPISODE."""
    options["headless"] = options["headless"] or as_json
    if isnan(options["speed"]):
        raise InputError("--speed", "a number above 0", "nan")
    if episode is None:
        png = png or Path("episode.png")
        _check_picture(png, options["record"])
        summary = _run(png=png, **options)
    else:
        if png is not None:
            _check_picture(png, episode)
        _check_play_back(ctx)
        summary = _play_back(episode, png, options["speed"], options["headless"])
    click.echo(json.dumps(summary) if as_json else _as_text(summary))


def _check_play_back(ctx: click.Context) -> None:
    """Raise InputError where an option was given that the recorded episode has decided."""
    for name in RUN_ONLY:
        if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = f"--{name.replace('_', '-')}"
            raise InputError(option, "no such option when an episode is played back")


def _check_picture(png: Path, episode: Path) -> None:
    """Raise InputError where the picture cannot be written, or would take the episode's place."""
    if png.resolve() == episode.resolve():
        raise InputError("--png", "another file than the episode's", str(png))
    check_png(png)
    check_file(png)


def _run(
    *,
    world: str,
    mapper: str,
    mapper_config: Path | None,
    agent: str,
    seed: int,
    steps: int,
    record: Path,
    png: Path,
    speed: float,
    headless: bool,
    no_movables: bool,
    **sensors: Any,
) -> dict[str, Any]:
    """Run an episode; its summary. `sensors` holds the presets of `SENSORS`."""
    import gymnasium

    from albot_agents.agent import begin_episode
    from albot_agents.registry import check_agent, find_agent, make_agent
    from albot_cli.live_view import open_live_view
    from albot_env.recording.writer import EpisodeWriter
    from albot_env.tasks.explore.env import ExploreEnv

    settings = {"world": world, "mapper": mapper, "movables": not no_movables, **sensors}
    if mapper_config is not None:
        settings["mapper_config"] = read_mapper_config(mapper_spec(mapper), mapper_config)
    check_agent(agent, ExploreEnv.task.environment)
    settings = find_agent(agent).environment(ExploreEnv.task.environment, settings)
    env = gymnasium.make(ExploreEnv.task.environment, max_episode_steps=steps, **settings)
    driver = make_agent(agent, env.get_wrapper_attr("observing"), ExploreEnv.task.environment)
    warm_up(mapper)
    explorer = env.unwrapped
    assert isinstance(explorer, ExploreEnv)
    explorer.recorder = EpisodeWriter(record, agent=agent)
    try:
        first = begin_episode(env, driver, seed)
        title = f"{agent} in {world}"
        with (
            _told_what_is_left(record),
            open_live_view(title, total=steps, speed=speed, headless=headless) as view,
        ):
            driven, contacts, info = _drive(env, explorer, driver, first, view)
        _save_picture(explorer.frame, png)
    finally:
        env.close()
    return {
        "world": world,
        "agent": agent,
        "mapper": mapper,
        "seed": seed,
        "steps": driven,
        "path_m": info["path_length"],
        "updates": info["updates"],
        "surfaces": info["surfaces"],
        "position_error_m": info["position_error"],
        "files": {"episode": str(record), "picture": str(png)},
        "simulated_s": info["time"],
        "coverage": info["coverage"],
        "rooms_entered": info["rooms_entered"],
        "steps_in_contact": contacts,
    }


@contextmanager
def _told_what_is_left(record: Path) -> Iterator[None]:
    """Say, where Ctrl-C ends the episode, that what was driven is not lost."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"albot: {record} holds the episode up to here", err=True)
        raise


def _drive(
    env: gymnasium.Env[Any, Any],
    explorer: ExploreEnv,
    driver: Agent,
    first: tuple[Any, dict[str, Any]],
    view: LiveView,
) -> tuple[int, int, dict[str, Any]]:
    """Drive to the end, or until nobody watches: steps, steps in contact, and the last info."""
    from albot_agents.agent import choose_action

    observation, info = first
    steps, contacts, over = 0, 0, False
    while not over:
        observation, _, terminated, truncated, info = env.step(
            choose_action(driver, observation, info)
        )
        steps += 1
        contacts += info["collided"]
        watched = view.step(info["time"], lambda: explorer.frame)
        over = terminated or truncated or not watched
    view.end(explorer.frame)
    return steps, contacts, info


def _play_back(episode: Path, png: Path | None, speed: float, headless: bool) -> dict[str, Any]:
    """Play an episode back; its summary."""
    from albot_cli.live_view import open_live_view
    from albot_env.recording.reader import EpisodeReader
    from albot_env.rendering.trace import Trace

    reader = EpisodeReader(episode)
    header, moments = reader.header, reader.moments()
    moment = next(moments, None)
    if moment is None:
        raise InputError(episode, "an episode with at least one step", "its header alone")
    trace, steps, collisions = Trace(header, moment), 0, 0
    rooms = {moment.room} - {""}
    with open_live_view(f"{episode}", total=None, speed=speed, headless=headless) as view:
        for moment in moments:
            trace.add(moment)
            steps += 1
            collisions += moment.collided
            rooms |= {moment.room} - {""}
            if not view.step(moment.reading.stamp, lambda: trace.frame):
                break
        view.end(trace.frame)
    if reader.torn:
        click.echo(f"albot: {episode}: ends early; what is there was played", err=True)
    if png is not None:
        _save_picture(trace.frame, png)
    frame = trace.frame
    return {
        "world": header.world,
        "agent": reader.agent,
        "mapper": header.mapper,
        "seed": header.seed,
        "steps": steps,
        "path_m": frame.path_length,
        "updates": frame.updates,
        "surfaces": len(frame.snapshot.segments),
        "position_error_m": frame.position_error,
        "files": {"episode": str(episode), "picture": None if png is None else str(png)},
        "simulated_s": frame.time,
        "coverage": None,
        "rooms_entered": len(rooms),
        "steps_in_contact": collisions,
        "torn": reader.torn,
    }


def _save_picture(frame: Frame, path: Path) -> None:
    """Save the picture; matplotlib is loaded no sooner than it is needed."""
    from albot_env.rendering.picture import save_picture

    save_picture(frame, path)


def _as_text(summary: dict[str, Any]) -> str:
    """The summary for people."""
    covered = summary["coverage"]
    figures = [
        f"{summary['path_m']:.1f} m driven",
        f"{summary['updates']} updates",
        f"{summary['surfaces']} surfaces",
        f"{summary['position_error_m']:.2f} m off",
        f"{summary['rooms_entered']} rooms entered",
        *([] if covered is None else [f"{covered:.0%} of the ground covered"]),
    ]
    lines = [
        f"{summary['agent']} in {summary['world']} with {summary['mapper']}, "
        f"seed {summary['seed']}, {summary['simulated_s']:.0f} s:",
        f"  {' · '.join(figures)}",
        f"  episode  {summary['files']['episode']}  (albot play FILE, or open it in Foxglove)",
    ]
    if summary["files"]["picture"]:
        lines.append(f"  picture  {summary['files']['picture']}")
    return "\n".join(lines)


def warm_up(mapper: str) -> None:
    """Where nothing is compiled yet, compile the mapper and all else at the same time.

    numba compiles one function at a time in a process, so the mapper gets a process of
    its own. Without this an episode runs just as well, and its first steps take longer.
    """
    import gymnasium

    from albot_env.sim.sensing import sense
    from albot_env.tasks.core.settings import NO_MAPPER
    from albot_env.tasks.explore.task import ExploreTask

    if _is_compiled(sense.compiled):
        return
    click.echo("albot: compiling, for the first time only", err=True)
    command = [sys.executable, "-m", "albot_core.mappers.precompile", mapper]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            env = gymnasium.make(ExploreTask.environment, world="square-loop", mapper=NO_MAPPER)
            env.reset(seed=0)
            env.step(env.action_space.sample())
            env.close()
            process.wait()
        finally:
            process.kill()  # Where this was interrupted; one that has ended stays as it is.


def _is_compiled(function: object) -> bool:
    """Whether numba has kept a compiled form of a function, of this version or an older one."""
    name = getattr(function, "__qualname__", "")
    folder = Path(function.stats.cache_path)  # type: ignore[attr-defined]
    return any(folder.glob(f"*.{name}-*.nbi"))
