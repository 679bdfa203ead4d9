"""The part of `albot results` that compares mappers: its rows, the costs, and the picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from albot_cli.progress import progress
from albot_core.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from albot_agents.benchmark.entrant import Entrant
    from albot_agents.benchmark.folder import ResultsFolder
    from albot_agents.benchmark.page import Report
    from albot_agents.benchmark.protocol import Protocol
    from albot_agents.benchmark.run import Row

EVERY = "all"
"""Name that stands for no mapper and all that are installed."""
_WORLD, _SEED, _STEPS = "random:office:900", 900, 1000
"""The readings on which costs are measured: an office of the validation seeds, explored."""
_AGENT, _ODOMETER, _SCENES, _COMPASS = "gap-explorer", "pioneer", "paper", "polarised"


def rows_of_mappers(
    protocol: Protocol,
    mappers: Sequence[str],
    tasks: Sequence[str],
    agents: Sequence[str],
    kinds: Sequence[str],
    odometers: Sequence[str],
) -> list[Row]:
    """Return the rows that compare mappers.

    Args:
        protocol: The protocol.
        mappers: Names of mappers, `none`, or `EVERY`.
        tasks: Ids of tasks; none for all in which mappers are compared.
        agents: Names of agents; none for the one of each task.
        kinds: Kinds of worlds that were asked for.
        odometers: Presets of odometer noise; none for all of the protocol.

    Raises:
        InputError: A name is unknown, or an agent has no row: it is for none of the tasks, or its
            figures would not be shown, or no mapper suits it.
    """
    from albot_agents.benchmark.entrant import find_entrant
    from albot_agents.benchmark.mappers import AGENTS, WORLDS, mapper_rows
    from albot_agents.registry import BY_MAP
    from albot_core.mappers.registry import (
        NO_MAPPER,
        check_installed,
        installed_mappers,
        mapper_spec,
    )

    if set(kinds) - {WORLDS}:
        raise InputError("--worlds", f"{WORLDS}, in which mappers are compared", ", ".join(kinds))
    for task in tasks:
        if task not in AGENTS:
            expected = f"a task in which mappers are compared: {', '.join(AGENTS)}"
            raise InputError("--task", expected, f"{task}{did_you_mean(task, AGENTS)}")
    every = (NO_MAPPER, *installed_mappers())
    names = [each for name in mappers for each in (every if name == EVERY else (name,))]
    for name in names:
        if name != NO_MAPPER:
            check_installed(mapper_spec(name))
    entrants = {entrant.name: entrant for entrant in map(find_entrant, agents)}
    chosen = {
        task: [
            each.source
            for each in entrants.values()
            if each.entry.attempts(task) and (task == BY_MAP or each.name == usual)
        ]
        if agents
        else [usual]
        for task, usual in AGENTS.items()
        if not tasks or task in tasks
    }
    rows = mapper_rows(protocol, names, chosen, tuple(odometers) or protocol.odometers)
    if not rows:
        expected = "an agent for a task in which mappers are compared, which sees what they give"
        raise InputError("albot results", expected, ", ".join((*tasks, *agents, *mappers)))
    check_all_enter(entrants.values(), rows)
    return rows


def check_all_enter(entrants: Iterable[Entrant], rows: Sequence[Row]) -> None:
    """Raise InputError for an agent that was asked for and has no row."""
    entered = {row.entrant.name for row in rows}
    for entrant in entrants:
        if entrant.name not in entered:
            expected = "agents that each have a row in these tasks and worlds"
            raise InputError("--agent", expected, entrant.source)


def measure_costs(folder: ResultsFolder, mappers: Sequence[str]) -> bool:
    """Measure the costs of those mappers that a folder lacks; return whether Ctrl-C stopped it.

    Raises:
        InputError: The folder's costs are damaged, or cannot be written, or another process writes
            into it.
    """
    from albot_agents.benchmark.costs import add_costs, read_costs
    from albot_benchmarks.mapper import relative_cost
    from albot_cli.explored_logs import Exploration, explore
    from albot_core.mappers.registry import NO_MAPPER

    known = read_costs(folder.path)
    missing = [name for name in dict.fromkeys(mappers) if name not in (NO_MAPPER, *known)]
    if not missing:
        return False
    sensors = {"odometer": _ODOMETER, "scenes": _SCENES, "compass": _COMPASS}
    way = Exploration(world=_WORLD, seed=_SEED, agent=_AGENT, steps=_STEPS, sensors=sensors)
    try:
        readings = list(explore(way).readings)
        with progress("costs", len(missing), "mappers") as update:
            for number, name in enumerate(missing):
                cost = relative_cost(name, readings)
                with folder.locked():
                    add_costs(folder.path, {name: cost})
                update(number + 1, name)
    except KeyboardInterrupt:
        return True
    return False


def draw_mappers(report: Report, page: Path) -> Report:
    """Draw the picture of the mappers beside the page, if there is one; return the report with it.

    Raises:
        InputError: It cannot be written.
    """
    mappers = report.mappers
    driver = mappers.drivers[0] if mappers.drivers else ""
    if driver not in mappers.curves:
        return report
    from albot_agents.benchmark.mapper_picture import mappers_figure
    from albot_core.drawing.figure import save_figure

    picture = page.with_name(f"{page.stem}-mappers.png")
    rows = [row for row in mappers.rows if row.driver == driver]
    save_figure(mappers_figure(rows, mappers.curves[driver], mappers.costs), picture)
    return replace(report, picture=picture.name)
