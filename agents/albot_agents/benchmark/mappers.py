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
    claims: int
    """Number of episodes of exploring."""
    places: int
    """Number of episodes of place recognition."""
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

    A driver is an agent that came home with two mappers or more; its rows are of these. The first
    driver, `map-homing`, is there too if mappers were compared in exploring or places alone, and
    its rows are of all that were in any of the tasks.
    """
    cells = {found.cell: found.episodes for found in results if found.episodes}
    of_driver: dict[str, list[Cell]] = {}
    for cell in cells:
        driver = AGENTS[BY_MAP] if AGENTS.get(cell.task) == cell.agent else cell.agent
        if cell.worlds == WORLDS and (cell.task == BY_MAP or driver != cell.agent):
            of_driver.setdefault(driver, []).append(cell)
    order = [NO_MAPPER, *mapper_names()]
    rows = []
    for driver in sorted(of_driver, key=lambda name: (name != AGENTS[BY_MAP], name)):
        compared = [some for some in _by_task(of_driver[driver]) if len(some) > 1]
        mappers = dict.fromkeys(mapper for some in compared for mapper in some)
        for odometer in protocol.odometers:
            measured = {cell.mapper for cell in of_driver[driver] if cell.odometer == odometer}
            rows += [
                _row(driver, mapper, odometer, cells)
                for mapper in sorted(mappers, key=lambda name: _place(order, name))
                if mapper in measured
            ]
    return rows


def _by_task(cells: Iterable[Cell]) -> list[list[str]]:
    """Return the mappers of cells, task by task."""
    found: dict[str, dict[str, None]] = {}
    for cell in cells:
        found.setdefault(cell.task, {})[cell.mapper] = None
    return [[*mappers] for mappers in found.values()]


def _place(order: Sequence[str], mapper: str) -> tuple[int, str]:
    return order.index(mapper) if mapper in order else len(order), mapper


def _row(
    driver: str, mapper: str, odometer: str, cells: Mapping[Cell, Sequence[EpisodeResult]]
) -> MapperRow:
    def measured(task: str, agent: str) -> Sequence[EpisodeResult]:
        cell = Cell(task=task, agent=agent, mapper=mapper, odometer=odometer, worlds=WORLDS)
        return cells.get(cell, ())

    homing = measured(BY_MAP, driver)
    claims, places = (measured(task, AGENTS[task]) for task in (EXPLORE, PLACES))
    figures = _homing_figures(homing) if homing else {}
    for name, episodes in (("claims", claims), ("places", places)):
        known = estimate(episodes) if episodes else {}
        figures |= {
            f"{name}_{figure}": known[figure]
            for figure in ("precision", "recall")
            if figure in known
        }
    _add(figures, "blur", [_blur(one) for one in claims], np.mean)
    return MapperRow(
        driver=driver,
        mapper=mapper,
        odometer=odometer,
        episodes=len(homing),
        claims=len(claims),
        places=len(places),
        figures=figures,
    )


def _homing_figures(episodes: Sequence[EpisodeResult]) -> dict[str, Estimate]:
    found = estimate(episodes)
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
    return figures


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
