"""Mappers compared: the same agent with each of them, in the same episodes.

- `Albot/HomingByMap-v0` under `map-homing`, and under other drivers on request. Nobody plans for
  the agent there, so what differs is where the mapper believes home; in `Albot/Homing-v0` it
  would also be which mapper plans a way.
- `Albot/Explore-v0` under `gap-explorer`, which claims to know a place when its mapper says so.
- `Albot/PlaceRecognition-v0` under `place-judge`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from albot_agents.benchmark.cell import Cell, EpisodeResult
from albot_agents.benchmark.entrant import Entrant, find_entrant
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.protocol import Protocol
from albot_agents.benchmark.run import Row
from albot_agents.benchmark.table import Estimate, estimate
from albot_agents.registry import BY_MAP, EXPLORE, PLACES, AgentEntry, agent_names, find_agent
from albot_agents.task import config_kind
from albot_core.errors import InputError
from albot_core.evaluation.intervals import bootstrap, wilson
from albot_core.mappers.registry import NO_MAPPER, mapper_names, mapper_spec

AGENTS: Mapping[str, str] = {BY_MAP: "map-homing", EXPLORE: "gap-explorer", PLACES: "place-judge"}
"""The tasks in which mappers are compared, and the agent in each."""
WORLDS = "offices"
"""Kind of worlds of the table of mappers."""
_NEEDED = {"scene": {"scenes": "paper"}, "compass": {"compass": "polarised"}}
"""The setting for each sensor that robots carry only if their mapper needs it."""
_SEED = 0
"""Seed of the bootstrap."""


@dataclass(frozen=True, kw_only=True)
class MapperRow:
    """The figures of a mapper with one odometer, under one driver."""

    driver: str
    """Name of the agent that drives home."""
    mapper: str
    """The mapper's name, or `none`."""
    odometer: str
    """Preset of the odometer's noise."""
    episodes: int
    """Number of episodes of coming home."""
    figures: Mapping[str, Estimate]
    """The figures that are known:

    - `success_rate`, `spl`: of coming home,
    - `carried_rate`, `uncarried_rate`: the first in episodes in which the robot was carried before
      the return, and in the others,
    - `home_error_begin`, `home_error`: median of the error of home when the return begins, and in
      the end, of these others (m; see `MapFigures`),
    - `blur`: mean excess of the map's entropy over that of the true map, after exploring (nats),
    - `claims_precision`, `claims_recall`: of claims to know a place, in exploring,
    - `places_precision`, `places_recall`: in place recognition."""


def sensors_for(mapper: str) -> dict[str, str]:
    """Return the sensors that a mapper needs besides the usual ones, by name of the setting."""
    needed = frozenset() if mapper == NO_MAPPER else mapper_spec(mapper).sensors
    return {
        name: preset
        for sensor, setting in _NEEDED.items()
        if sensor in needed
        for name, preset in setting.items()
    }


def suits(entry: AgentEntry, mapper: str) -> bool:
    """Return whether an agent observes the same with a mapper as with its own.

    A trained agent knows no other observations; a scripted one is asked to do with any.
    """
    if entry.file is None:
        return True
    seen = entry.configs.observations
    own, other = (
        None if name == NO_MAPPER else mapper_spec(name) for name in (entry.mapper, mapper)
    )
    try:
        found = seen.fitted(seen.laser, seen.sonar, other, has_compass=seen.has_compass)
    except InputError:  # The mapper cannot give one of its parts.
        return False
    before = seen.fitted(seen.laser, seen.sonar, own, has_compass=seen.has_compass)
    return found.shapes == before.shapes


def mapper_rows(
    protocol: Protocol,
    mappers: Iterable[str],
    agents: Mapping[str, Sequence[str]],
    odometers: tuple[str, ...],
    worlds: tuple[str, ...] = (WORLDS,),
) -> list[Row]:
    """Return the rows of agents with each mapper that suits them.

    Args:
        protocol: The protocol.
        mappers: Names of the mappers, or `none`.
        agents: The agents of each task.
        odometers: Presets of odometer noise.
        worlds: Kinds of worlds.
    """
    names = list(dict.fromkeys(mappers))
    return [
        Row(
            entrant=_with_mapper(find_entrant(agent), mapper),
            task=task,
            odometers=odometers,
            worlds=worlds,
        )
        for task in protocol.tasks
        for agent in agents.get(task, ())
        for mapper in names
        if suits(find_agent(agent), mapper)
    ]


def _with_mapper(entrant: Entrant, mapper: str) -> Entrant:
    return Entrant(
        name=entrant.name,
        source=entrant.source,
        entry=entrant.entry,
        mapper=mapper,
        settings=sensors_for(mapper),
    )


def home_radius() -> float:
    """Return the distance from the start within which a robot is home (m)."""
    return float(config_kind(BY_MAP)().radius)


def is_carried(episode: EpisodeResult) -> bool:
    """Return whether the robot was carried before the return: no map can tell it where to."""
    return bool(episode.info.get("change") == "carried")


def has_own_mapper(cell: Cell, agents: Mapping[str, Mapping[str, Any]]) -> bool:
    """Return whether a cell is one of the table of agents: an agent with its own mapper.

    Args:
        cell: The cell.
        agents: Facts of the trained agents, by name (`ResultsFolder.read_agents`).
    """
    if cell.agent in agents:
        return bool(agents[cell.agent]["mapper"] == cell.mapper)
    return cell.agent not in agent_names() or find_agent(cell.agent).mapper == cell.mapper


def make_mapper_table(results: Iterable[CellResults], protocol: Protocol) -> list[MapperRow]:
    """Return the figures of all mappers: drivers, odometers and mappers in a fixed order.

    A driver is an agent that came home with two mappers or more.
    """
    cells = {found.cell: found.episodes for found in results if found.episodes}
    homing = [cell for cell in cells if cell.task == BY_MAP and cell.worlds == WORLDS]
    own = AGENTS[BY_MAP]
    drivers = sorted({cell.agent for cell in homing}, key=lambda name: (name != own, name))
    order = [NO_MAPPER, *mapper_names()]
    rows = []
    for driver in drivers:
        its = [cell for cell in homing if cell.agent == driver]
        if len({cell.mapper for cell in its}) < 2:
            continue
        for odometer in protocol.odometers:
            found: Iterable[Cell] = (cell for cell in its if cell.odometer == odometer)
            found = sorted(found, key=lambda cell: _place(order, cell.mapper))
            rows += [_row(cell, cells) for cell in found]
    return rows


def _place(order: Sequence[str], mapper: str) -> tuple[int, str]:
    return order.index(mapper) if mapper in order else len(order), mapper


def _row(cell: Cell, cells: Mapping[Cell, Sequence[EpisodeResult]]) -> MapperRow:
    episodes, found = cells[cell], estimate(cells[cell])
    figures = {name: each for name, each in found.items() if name in ("success_rate", "spl")}
    carried = [one for one in episodes if is_carried(one)]
    others = [one for one in episodes if not is_carried(one)]
    for name, some in (("carried_rate", carried), ("uncarried_rate", others)):
        if some:
            home = sum(bool(one.info["is_success"]) for one in some)
            interval = wilson(home, len(some))
            figures[name] = Estimate(value=home / len(some), ci95=interval)
    for name in ("home_error_begin", "home_error"):
        _add(figures, name, [one.info.get(name) for one in others], np.median)
    for task, name in ((EXPLORE, "claims"), (PLACES, "places")):
        same = Cell(
            task=task,
            agent=AGENTS[task],
            mapper=cell.mapper,
            odometer=cell.odometer,
            worlds=cell.worlds,
        )
        measured = cells.get(same, ())
        known = estimate(measured) if measured else {}
        figures |= {
            f"{name}_{figure}": known[figure]
            for figure in ("precision", "recall")
            if figure in known
        }
        if task == EXPLORE:
            _add(figures, "blur", [_blur(one) for one in measured], np.mean)
    return MapperRow(
        driver=cell.agent,
        mapper=cell.mapper,
        odometer=cell.odometer,
        episodes=len(episodes),
        figures=figures,
    )


def _blur(episode: EpisodeResult) -> float | None:
    believed, true = (episode.info.get(name) for name in ("map_entropy", "true_map_entropy"))
    return None if believed is None or true is None else float(believed - true)


def _add(
    figures: dict[str, Estimate],
    name: str,
    values: Sequence[float | None],
    measure: Callable[..., Any],
) -> None:
    """Add a statistic of the known values with its bootstrapped interval, if any is known."""
    known = np.array([value for value in values if value is not None], np.float64)
    if len(known):
        interval = bootstrap(known, measure, np.random.default_rng(_SEED))
        figures[name] = Estimate(value=float(measure(known)), ci95=interval)
