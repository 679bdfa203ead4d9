"""`albot stress`: drive agents through many worlds and check every step."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, closing, nullcontext
from itertools import count as counting
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from albot_cli import completion
from albot_cli.engine_options import engine_options
from albot_cli.faults import faults_option
from albot_cli.mappers import mapper_config_option, read_robots_config
from albot_cli.number_types import CountType, RealType
from albot_cli.outputs import JSON, check_folder
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_cli.robots import robot_option
from albot_cli.rows_options import (
    RESUME,
    ROWS,
    ResumableCommand,
    continued,
    rows_place,
    words_of,
)
from albot_cli.signals import STOPPED
from albot_core.counts import many
from albot_core.errors import InputError
from albot_core.files import make_folder, write_text

if TYPE_CHECKING:
    from albot_agents.engine.engine import Engine
    from albot_agents.engine.rows import RowsFolder
    from albot_stress.campaign import Campaign
    from albot_stress.episodes import Outcome, Violation

_LARGEST_SEED = 2**64 - 1
"""The same value as a campaign's, whose module is slow to load."""
_SHRUNK = 10
"""Number of violations that are shrunk, at most."""
_PLAN = (
    "worlds", "count", "steps", "seed", "agents", "mapper", "mapper_config", "robot", "odometer",
    "faults",
)  # fmt: skip
"""The options that a campaign's file stands for."""


@click.command(cls=ResumableCommand)
@click.argument("campaign", required=False, type=PathType(dir_okay=False))
@click.option(
    "--worlds",
    default="random",
    show_default=True,
    metavar="SPEC",
    shell_complete=completion.world_names,
    help="random:KIND or random:KIND?KEY=VALUE&…; random for all kinds in turn; or one world.",
)
@click.option(
    "--count",
    default=100,
    show_default=True,
    type=CountType(1, 1_000_000),
    help="Worlds.",
)
@click.option(
    "--steps",
    default=300,
    show_default=True,
    type=CountType(1),
    help="Length of an episode, in steps of 0.1 s.",
)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=CountType(0, _LARGEST_SEED),
    help="The first seed, of worlds and episodes.",
)
@click.option(
    "--agent",
    "agents",
    multiple=True,
    default=("gap-explorer", "random"),
    shell_complete=completion.agent_names,
    show_default=True,
    help="association-explorer, exploring (--mapper albot1), gap-explorer, nearest-frontier, "
    "onward-follower, random, ratslam-explorer, or the file of a trained agent; repeatable.",
)
@click.option(
    "--mapper",
    default="none",
    show_default=True,
    shell_complete=completion.robots_mapper_names,
    help="See `albot mappers`; or none.",
)
@mapper_config_option
@robot_option
@click.option(
    "--odometer",
    shell_complete=completion.odometer_names,
    help="The odometer's preset.  [default: pioneer]",
)
@faults_option
@click.option(
    "--beams",
    type=RealType(0, 1, min_open=True),
    help="Share of the beams and sonars that are compared with the surfaces at each step, in "
    "turns; 1 for all.  [default: 0.125, or the campaign's]",
)
@click.option(
    "--shrink",
    "seconds",
    default=60.0,
    show_default=True,
    type=RealType(0),
    help="Time in which a simpler episode is searched for each of the first violations, in "
    "seconds; 0 for none.",
)
@click.option(
    "--out",
    type=PathType(file_okay=False),
    help="New folder for the episodes of violations.  [default: violations, or the first of "
    "violations-1, violations-2, … that is free]",
)
@ROWS
@RESUME
@engine_options
@JSON
@click.pass_context
def command(
    ctx: click.Context,
    /,
    campaign: Path | None,
    beams: float | None,
    seconds: float,
    out: Path | None,
    rows: Path | None,
    resume: Path | None,
    engine: Engine,
    as_json: bool,
    **plan: Any,
) -> int:
    """Drive agents through many worlds and check every step.

    CAMPAIGN is a YAML file (docs/campaigns.md) that lists worlds, agents, mappers, odometers and
    faults; all combinations run. Without it, the options say what runs.

    No number may be NaN or outside its space. Each reward must be the sum of its terms. No robot
    may be inside or behind a wall, or inside a movable, and no box or person in or behind a wall.
    Each laser beam must be as long as the distance to the nearest surface, and each sonar echo must
    come from a possible surface. Maps must be finite and bounded, and their places connected. A
    second mapper must believe the same of the same readings, and a recording must replay to the
    last bit. Each violation is shrunk to a simpler episode, stored, and printed with the command
    that shows it. The exit status is 0 without violations, 1 with some, and 130 if Ctrl-C stops it.
    """
    chosen = _campaign(ctx, campaign, beams, plan)
    tally = _Tally()
    place, resumes = rows_place(rows, resume)
    # The run that goes on may have made the folder.
    if out is not None and out.exists() and not resumes:
        raise InputError("--out", "a folder that is not there yet", str(out))
    if out is not None:
        check_folder(out)
    kept = None if place is None else _rows_folder(ctx, chosen, place)
    _run(chosen, engine, tally, kept, resumes)
    try:
        if tally.violations and seconds and not tally.stopped:
            _shrink(chosen, engine, tally, seconds, out or _free_folder())
    finally:  # What was found is told, even if it cannot be stored.
        lines = continued(ctx, place) if tally.stopped else []
        facts = tally.facts(chosen.agents) | {"rows": None if place is None else str(place)}
        click.echo(json.dumps(facts) if as_json else "\n".join([tally.text(), *lines]))
    if tally.violations:
        return 1
    return STOPPED if tally.stopped else 0


def _campaign(
    ctx: click.Context, file: Path | None, beams: float | None, plan: dict[str, Any]
) -> Campaign:
    """Return what runs, by the file or by the options.

    Raises:
        InputError: It is not valid; or there are a file and an option that it stands for.
    """
    from dataclasses import replace

    from albot_agents.registry import EXPLORE, check_agent
    from albot_stress.campaign import Campaign, MapperChoice, read_campaign
    from albot_stress.running import Checks

    if file is not None:
        for name in _PLAN:
            if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                option = f"--{name.replace('_', '-').replace('agents', 'agent')}"
                raise InputError(option, "no such option with a campaign", f"{file}")
        found = read_campaign(file)
    else:
        agents = tuple(dict.fromkeys(plan["agents"]))
        for name in agents:
            check_agent(name, EXPLORE)
        config_file, mapper = plan["mapper_config"], plan["mapper"]
        config = None if config_file is None else read_robots_config(mapper, config_file)
        found = Campaign(
            worlds=(plan["worlds"],),
            count=plan["count"],
            seed=plan["seed"],
            steps=plan["steps"],
            agents=agents,
            mappers=(MapperChoice(mapper, config, config_file),),
            odometers=(plan["odometer"],),
            faults=(plan["faults"],),
            robot=plan["robot"],
            checks=Checks(),
        )
        found.check()
    return found if beams is None else replace(found, checks=replace(found.checks, beams=beams))


def _free_folder() -> Path:
    """Return the first free name for the folder of violations."""
    names = (Path(f"violations-{k}" if k else "violations") for k in counting())
    return next(name for name in names if not os.path.lexists(name))


class _Tally:
    """The results so far."""

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self._worlds: set[tuple[str, int]] = set()
        self._episodes = 0
        self._steps = 0
        self._seconds = 0.0
        self.violations: list[Violation] = []
        """The violations."""
        self.shrunk: list[dict[str, Any]] = []
        """The shrunk ones, as rows of the JSON."""
        self.stopped = False
        """Whether Ctrl-C ended the run."""

    @property
    def note(self) -> str:
        """What is told of it beside the progress."""
        return many(len(self.violations), "violation") if self.violations else ""

    def add(self, outcome: Outcome) -> None:
        """Add the outcome of an episode."""
        episode = outcome.episode
        self._worlds.add((episode.world, episode.seed))
        self._episodes += 1
        self._steps += outcome.steps
        self._seconds = time.perf_counter() - self._began
        self.violations += outcome.violations

    def facts(self, agents: Iterable[str]) -> dict[str, Any]:
        """Return the results as the JSON object."""
        in_order = sorted(
            self.violations,
            key=lambda each: (each.episode.seed, each.episode.world, each.episode.agent),
        )
        return {
            "worlds": len(self._worlds),
            "agents": list(agents),
            "episodes": self._episodes,
            "steps": self._steps,
            "seconds": self._seconds,
            "steps_per_second": self._steps / self._seconds if self._seconds else 0.0,
            "stopped": self.stopped,
            "violations": [_row(violation) for violation in in_order],
            "shrunk": self.shrunk,
        }

    def text(self) -> str:
        """Return the results as text."""
        facts = self.facts(())
        lines = [
            f"step {each['step']}: {each['what']}\n  {each['command']}"
            for each in facts["violations"]
        ]
        for each in self.shrunk:
            stored = f" ({each['episode']})" if each["episode"] else ""
            lines.append(
                f"shrunk: step {each['step']}: {each['what']}{stored}\n  {each['command']}"
            )
        found = len(self.violations)
        lines.append(
            f"{many(facts['worlds'], 'world')}, {many(facts['episodes'], 'episode')}, "
            f"{many(facts['steps'], 'step')} in {facts['seconds']:.0f} s "
            f"({facts['steps_per_second']:,.0f} steps/s): "
            f"{many(found, 'violation') if found else 'no violations'}"
            f"{', stopped before the end' if self.stopped else ''}"
        )
        return "\n".join(lines)


def _row(violation: Violation) -> dict[str, Any]:
    """Return a violation as a row of the JSON."""
    return {
        "world": violation.episode.world,
        "agent": violation.episode.agent,
        "seed": violation.episode.seed,
        "step": violation.step,
        "invariant": violation.invariant,
        "what": violation.what,
        "command": violation.command,
    }


def _rows_folder(ctx: click.Context, campaign: Campaign, place: Path) -> RowsFolder:
    """Return the folder of the rows, which is neither read nor made yet."""
    from albot_agents.engine.rows import Manifest, RowsFolder, files_digest
    from albot_core.plain_data import to_plain
    from albot_stress.rows import COLUMNS

    plan = to_plain(campaign)
    plan["files"] = files_digest((*campaign.worlds, *campaign.agents))
    tasks = len(campaign.episodes())
    manifest = Manifest(command="stress", words=words_of(ctx), plan=plan, tasks=tasks)
    return RowsFolder(path=place, manifest=manifest, columns=COLUMNS)


def _run(
    campaign: Campaign, engine: Engine, tally: _Tally, rows: RowsFolder | None, resumes: bool
) -> None:
    """Run the episodes that the rows lack until all are done or Ctrl-C."""
    from albot_stress.episodes import plan_jobs
    from albot_stress.rows import episode_key, outcome_of, row_of
    from albot_stress.running import run_jobs

    engine.start()
    episodes = campaign.episodes()
    numbers = {episode_key(episode): number for number, episode in enumerate(episodes)}
    total = len(episodes) * campaign.steps
    opened: AbstractContextManager[Mapping[int, Any]]
    opened = nullcontext({}) if rows is None else rows.opened(resume=resumes)
    try:
        with opened as known:
            for number, row in known.items():
                assert rows is not None
                tally.add(outcome_of(row, episodes[number], rows.path))
            left = [episode for number, episode in enumerate(episodes) if number not in known]
            outcomes = run_jobs(plan_jobs(left, engine.workers), engine, campaign.checks)
            start = len(known) * campaign.steps
            with progress("stress", total, "steps", start=start) as update, closing(outcomes):
                for done, outcome in enumerate(outcomes, start=len(known) + 1):
                    if rows is not None:
                        rows.add(numbers[episode_key(outcome.episode)], row_of(outcome))
                    tally.add(outcome)
                    update(done * campaign.steps, tally.note)
    except KeyboardInterrupt:
        tally.stopped = True


def _shrink(
    campaign: Campaign, engine: Engine, tally: _Tally, seconds: float, folder: Path
) -> None:
    """Shrink the first violations of each kind, and store their episodes."""
    from albot_agents.engine.engine import Crash
    from albot_stress.shrinking import ShrinkTask, Shrunk, shrink

    kinds = {
        (each.invariant, each.episode.agent, each.episode.mapper, each.episode.faults): each
        for each in reversed(tally.violations)
    }
    make_folder(folder)
    tasks = [
        ShrinkTask(
            violation=violation,
            checks=campaign.checks,
            seconds=seconds,
            record=folder / f"violation-{number}.mcap",
        )
        for number, violation in enumerate(list(reversed(kinds.values()))[:_SHRUNK], start=1)
    ]
    found: dict[int, dict[str, Any]] = {}
    try:
        with (
            progress("shrinking", len(tasks), "violations") as update,
            closing(engine.run(shrink, tasks)) as results,
        ):
            for done in results:
                violation, tried = done.task.violation, 0
                if not isinstance(done.result, Crash):
                    shrunk: Shrunk = done.result
                    violation, tried = shrunk.violation, shrunk.tried
                record = done.task.record
                stored = str(record) if record is not None and record.exists() else None
                found[done.number] = {**_row(violation), "tried": tried, "episode": stored}
                update(len(found))
    except KeyboardInterrupt:
        tally.stopped = True
    tally.shrunk = [found[number] for number in sorted(found)]
    write_text(folder / "violations.json", json.dumps(tally.facts(campaign.agents), indent=1))
