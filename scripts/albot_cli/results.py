"""`albot results`: run the benchmark, and make its page."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_cli import completion
from albot_cli.engine_options import engine_options
from albot_cli.mapper_results import (
    EVERY,
    check_all_enter,
    draw_mappers,
    measure_costs,
    rows_of_mappers,
)
from albot_cli.number_types import CountType
from albot_cli.outputs import JSON, check_file, check_folder
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_cli.signals import STOPPED
from albot_core.counts import many
from albot_core.errors import InputError, did_you_mean
from albot_core.files import write_text
from albot_core.interrupts import interrupts_deferred

if TYPE_CHECKING:
    from albot_agents.benchmark.folder import ResultsFolder
    from albot_agents.benchmark.page import Report
    from albot_agents.benchmark.protocol import Protocol
    from albot_agents.benchmark.run import BenchmarkRun, Row
    from albot_agents.benchmark.times import RowTime
    from albot_agents.engine.engine import Engine

_PAGE = "results.md"


@click.command()
@click.option(
    "--out",
    required=True,
    type=PathType(file_okay=False),
    help="Folder of the results. What it has is kept, and what it lacks is run.",
)
@click.option(
    "--protocol",
    "version",
    type=CountType(1),
    help="Version of the protocol.  [default: the folder's, or the latest]",
)
@click.option(
    "--task",
    "tasks",
    multiple=True,
    shell_complete=completion.task_names,
    help="Only this task; repeatable.",
)
@click.option(
    "--agent",
    "agents",
    multiple=True,
    shell_complete=completion.agent_names,
    help="Only this agent, by its name or its file; repeatable. A file is run in the task that it "
    "was trained for, or in --task.",
)
@click.option(
    "--mapper",
    "mappers",
    multiple=True,
    metavar="NAME",
    shell_complete=completion.compared_mapper_names,
    help="Compare mappers: run this one under map-homing, gap-explorer and place-judge, or under "
    f"--agent; `{EVERY}` for none and all that are installed; repeatable.",
)
@click.option(
    "--worlds",
    "kinds",
    multiple=True,
    metavar="KIND",
    shell_complete=completion.benchmark_worlds,
    help=f"Only these worlds: {completion.listed(completion.BENCHMARK_WORLDS)}; repeatable.",
)
@click.option(
    "--odometer",
    "odometers",
    multiple=True,
    shell_complete=completion.benchmark_odometers,
    help=f"Only this odometer: {completion.listed(completion.BENCHMARK_ODOMETERS)}; repeatable.",
)
@click.option(
    "--episodes",
    type=CountType(0),
    help="Only the first episodes of each cell; 0 for the page alone.  [default: the protocol's]",
)
@click.option(
    "--check",
    type=CountType(1),
    help="Run nothing new, but the first episodes of each cell again, as many at most: the exit "
    "status is 1 if one differs. Cells of other sources whose episodes are the same become cells "
    "of the installed ones.",
)
@click.option(
    "--plans",
    type=PathType(file_okay=False, exists=True),
    help="Folder of the real floor plans in XML; without it, none are run.",
)
@click.option(
    "--page",
    type=PathType(dir_okay=False),
    help="The page, a .md file; its figures go into a JSON file beside it.  "
    f"[default: {_PAGE} in the folder]",
)
@click.option(
    "--from",
    "sources",
    multiple=True,
    type=PathType(),
    help="First add the results in this file (of --rows) or folder to those of the folder; "
    "repeatable.",
)
@click.option(
    "--rows",
    "rows_file",
    type=PathType(dir_okay=False),
    help="Also write all results that the folder has into this file, a line an episode; its name "
    "ends in .jsonl.gz.",
)
@engine_options
@JSON
def command(
    out: Path,
    version: int | None,
    tasks: tuple[str, ...],
    agents: tuple[str, ...],
    mappers: tuple[str, ...],
    kinds: tuple[str, ...],
    odometers: tuple[str, ...],
    episodes: int | None,
    check: int | None,
    plans: Path | None,
    page: Path | None,
    engine: Engine,
    sources: tuple[Path, ...],
    rows_file: Path | None,
    as_json: bool,
) -> int:
    """Run the benchmark's episodes that a folder lacks, and write the page of all that it has.

    Tasks, worlds, seeds and odometers are those of a protocol, which is frozen (docs/benchmark.md).
    It can be stopped at any time, also by `kill`: the same command goes on. If Ctrl-C stops it, the
    page is written and the exit status is 130. It is 1 if episodes crashed, which are listed.
    Results of several machines add up by --rows there and --from here.
    """
    from albot_agents.benchmark.folder import ResultsFolder
    from albot_agents.benchmark.page import render_lines
    from albot_agents.benchmark.times import row_times, time_line

    page = out / _PAGE if page is None else page
    _check_outputs(out, page, rows_file)
    folder = ResultsFolder(out, version)
    choice = _Choice(tasks=tasks, agents=agents, mappers=mappers, kinds=kinds, odometers=odometers)
    rows = choice.rows(folder.protocol, has_plans=plans is not None or episodes == 0)
    most = _check_episodes(folder.protocol, rows, episodes, check)
    run = _begin(folder, rows, episodes, check, plans, sources)
    stopped = _run(run, engine)
    if mappers and not stopped and episodes != 0 and check is None:
        stopped = measure_costs(folder, [row.entrant.mapper for row in rows])
    with interrupts_deferred():
        report, files = _write(folder, page, rows_file)
    chosen = report.only({row.entrant.name for row in rows}) if agents else report
    times, checked = list(row_times(folder, rows)), _checked_facts(run)
    if as_json:
        facts: dict[str, Any] = {"protocol": folder.protocol.protocol}
        facts |= {"missing": run.missing, "stopped": stopped, **checked}
        facts["failed"] = [each.facts for each in run.failed]
        facts["files"] = {name: str(file) for name, file in files.items()}
        click.echo(json.dumps(facts | _figures(chosen, times, with_mappers=bool(mappers))))
    else:
        lines = [*render_lines(chosen), *map(time_line, times)] if agents else []
        if episodes != 0:
            lines += _told(run, episodes, most)
        lines += [each.text for each in run.failed]
        click.echo("\n".join([*lines, *map(str, files.values())]))
    return STOPPED if stopped else int(bool(run.failed or checked.get("differences")))


def _begin(
    folder: ResultsFolder,
    rows: list[Row],
    episodes: int | None,
    check: int | None,
    plans: Path | None,
    sources: tuple[Path, ...],
) -> BenchmarkRun:
    """Return the run of what is missing or checked, after results of other sources were added.

    Raises:
        InputError: A file is damaged, results contradict each other or are of others than the
            rows, or there are none for a page alone or to be checked. Then nothing is written.
    """
    from albot_agents.benchmark.check import BenchmarkCheck
    from albot_agents.benchmark.rows_file import Results, merge, read_results
    from albot_agents.benchmark.run import BenchmarkRun
    from albot_agents.benchmark.times import read_times

    others = [read_results(source, folder.protocol) for source in sources]
    results = merge([Results.of(folder), *others])
    read_times(folder.path)
    if episodes == 0 and not results.cells:
        raise InputError(folder.path, "a folder with results", "none")
    run: BenchmarkRun
    if check is not None:
        run = BenchmarkCheck(folder, rows, check, plans)
    else:
        run = BenchmarkRun(folder, [] if episodes == 0 else rows, episodes, plans)
    for other in others:
        run.take_stock(other.cells.values(), other.source)
    run.take_stock(results.cells.values())
    if check is not None and not run.missing:
        raise InputError("--check", f"results of these rows in {folder.path}", "none")
    if others:
        results.write(folder)
    return run


def _write(
    folder: ResultsFolder, page: Path, rows_file: Path | None
) -> tuple[Report, dict[str, Path]]:
    """Write the page, its figures and picture, and the file of rows; return report and files."""
    from albot_agents.benchmark.page import Report, page_data, render_page
    from albot_agents.benchmark.rows_file import Results, write_rows

    report = draw_mappers(Report.of(folder), page)
    files = {"page": page, "figures": page.with_suffix(".json")}
    if report.picture is not None:
        files["picture"] = page.with_name(report.picture)
    write_text(files["figures"], json.dumps(page_data(report), indent=1) + "\n")
    write_text(page, render_page(report, page.parent))
    if rows_file is not None:
        files["rows"] = rows_file
        write_rows(Results.of(folder), folder.protocol, rows_file)
    return report, files


def _figures(chosen: Report, times: list[RowTime], *, with_mappers: bool) -> dict[str, Any]:
    """Return the figures of the rows that were asked for, as plain data."""
    from albot_agents.benchmark.mapper_page import mapper_data
    from albot_agents.benchmark.page import page_data

    facts: dict[str, Any] = {"rows": page_data(chosen)["rows"]}
    facts["times"] = [asdict(row) for row in times]
    if with_mappers:
        facts["mappers"] = mapper_data(chosen.mappers)
    return facts


def _check_outputs(out: Path, page: Path, rows_file: Path | None) -> None:
    """Raise InputError if the folder, the page or the file of rows cannot be written."""
    from albot_agents.benchmark.rows_file import SUFFIX

    if page.suffix != ".md":
        raise InputError("--page", "a name that ends in .md", str(page))
    if rows_file is not None and not rows_file.name.endswith(SUFFIX):
        raise InputError("--rows", f"a name that ends in {SUFFIX}", str(rows_file))
    check_folder(out)
    others = [] if page.parent == out else [page, page.with_suffix(".json")]
    if rows_file is not None and rows_file.parent != out:
        others.append(rows_file)
    for file in others:
        check_file(file, force=True)


def _check_episodes(
    protocol: Protocol, rows: list[Row], episodes: int | None, check: int | None
) -> int:
    """Return the most episodes of a cell; raise InputError if more were asked for."""
    cells = [cell for row in rows for cell in row.cells]
    most = max(len(protocol.keys(cell.task, cell.worlds)) for cell in cells)
    if check is not None and episodes is not None:
        raise InputError("--episodes", "no such option with --check", str(episodes))
    for option, asked in (("--episodes", episodes), ("--check", check)):
        if asked is not None and asked > most:
            raise InputError(option, f"{most} at most, the protocol's", str(asked))
    return most


def _told(run: BenchmarkRun, episodes: int | None, most: int) -> list[str]:
    """Return what was checked, or what is left to be run, in words."""
    from albot_agents.benchmark.check import BenchmarkCheck

    lines = [f"{many(run.missing, 'episode')} to go"] if run.missing else []
    if isinstance(run, BenchmarkCheck):
        same = f"{many(run.same, 'episode')} the same, {many(len(run.differences), 'other')}"
        adopted = f"; {many(run.adopted, 'cell')} now of the installed sources"
        return [same + adopted, *(each.text for each in run.differences), *lines]
    is_all = "complete" if run.is_complete else f"{episodes} of {most} episodes a cell"
    return lines or [is_all]


def _checked_facts(run: BenchmarkRun) -> dict[str, Any]:
    """Return what was checked, as plain data; nothing of a run of what is missing."""
    from albot_agents.benchmark.check import BenchmarkCheck

    if not isinstance(run, BenchmarkCheck):
        return {}
    return {
        "same": run.same,
        "differences": [each.facts for each in run.differences],
        "adopted": run.adopted,
    }


@dataclass(frozen=True, kw_only=True)
class _Choice:
    """What the options ask for; none of a kind for all of it."""

    tasks: tuple[str, ...]
    """Names of tasks."""
    agents: tuple[str, ...]
    """Names or files of agents."""
    mappers: tuple[str, ...]
    """Names of mappers that are compared."""
    kinds: tuple[str, ...]
    """Kinds of worlds."""
    odometers: tuple[str, ...]
    """Presets of odometer noise."""

    def rows(self, protocol: Protocol, *, has_plans: bool) -> list[Row]:
        """Return the rows.

        Args:
            protocol: The protocol.
            has_plans: Whether floor plans can be run, or need not be.

        Raises:
            InputError: An option names what the protocol has not, or an agent has no row.
        """
        from albot_agents.task import find_task

        tasks = tuple(dict.fromkeys(map(find_task, self.tasks)))
        kinds, odometers = (tuple(dict.fromkeys(some)) for some in (self.kinds, self.odometers))
        _check_names("--odometer", odometers, protocol.odometers)
        if self.mappers:
            return rows_of_mappers(protocol, self.mappers, tasks, self.agents, kinds, odometers)
        _check_names("--task", tasks, protocol.tasks)
        _check_names("--worlds", kinds, protocol.worlds)
        return _rows(protocol, tasks, self.agents, kinds, odometers, has_plans)


def _rows(
    protocol: Protocol,
    tasks: tuple[str, ...],
    agents: tuple[str, ...],
    kinds: tuple[str, ...],
    odometers: tuple[str, ...],
    has_plans: bool,
) -> list[Row]:
    """Return the rows that the options ask for.

    Args:
        protocol: The protocol.
        tasks: Ids of tasks of the protocol; none for all.
        agents: Names or files of agents; none for all of a task.
        kinds: Kinds of worlds; none for all of a task.
        odometers: Presets of odometer noise; none for all.
        has_plans: Whether floor plans can be run, or need not be.

    Raises:
        InputError: There are no floor plans to run, or an agent has no row.
    """
    from albot_agents.benchmark.entrant import find_entrant
    from albot_agents.benchmark.protocol import PLANS
    from albot_agents.benchmark.run import Row
    from albot_agents.registry import agent_names

    if PLANS in kinds and not has_plans:
        raise InputError("--worlds", "--plans, the folder of the floor plans", "none")
    entrants = list({entrant.name: entrant for entrant in map(find_entrant, agents)}.values())
    rows = []
    for task in tasks or protocol.tasks:
        wanted = [kind for kind in protocol.tasks[task].worlds if not kinds or kind in kinds]
        worlds = tuple(kind for kind in wanted if kind != PLANS or has_plans)
        chosen = odometers or protocol.odometers
        for entrant in entrants or map(find_entrant, agent_names(task)):
            trained_for_it = entrant.entry.file is None or task in entrant.entry.tasks
            enters = entrant.entry.attempts(task) and (trained_for_it or tasks or not entrants)
            if worlds and enters:
                rows.append(Row(entrant=entrant, task=task, odometers=chosen, worlds=worlds))
    if not rows:
        found = ", ".join((*tasks, *agents, *kinds))
        raise InputError("albot results", "an agent for a task that has such worlds", found)
    check_all_enter(entrants, rows)
    return rows


def _check_names(option: str, names: tuple[str, ...], known: Iterable[str]) -> None:
    for name in names:
        if name not in known:
            found = f"{name}{did_you_mean(name, known)}"
            raise InputError(option, f"one of {', '.join(known)}", found)


def _run(run: BenchmarkRun, engine: Engine) -> bool:
    """Run what is missing; return whether Ctrl-C stopped it."""
    if not run.missing:
        return False
    try:
        with progress("results", run.missing, "episodes") as update:
            run.run(engine, update)
    except KeyboardInterrupt:
        return True
    return False
