"""How the page of results opens: agents by tasks, mappers by tasks, and what they show.

An agent's figure in a task is over all kinds of worlds, with as many episodes of each: the first
ones of the protocol. A sentence is made of no fewer than `FEWEST` episodes, each another one of the
protocol, and says that an agent is ahead of another only where the 95 % interval of the difference
in the same episodes leaves out zero. Agents with more episodes than others are compared in the
first ones, as many as the others have.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from albot_agents.benchmark.cell import EpisodeResult
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.mapper_page import MapperReport, cost_text
from albot_agents.benchmark.mappers import MapperRow
from albot_agents.benchmark.markdown import FEWEST, agent_text, written
from albot_agents.benchmark.protocol import Protocol
from albot_agents.benchmark.table import (
    FIGURES,
    SHORT,
    Estimate,
    compare,
    estimate,
    has_interval,
    named,
)
from albot_agents.registry import AGENTS
from albot_agents.task import is_probe, short_name
from albot_core.counts import many

PROBES = "probes"
"""Name of the column of all probes."""
_UPPER_BOUNDS = tuple(
    name for name, entry in AGENTS.items() if entry.make(entry.configs).knows_truth
)
"""Agents that know the truth."""


@dataclass(frozen=True, kw_only=True)
class Standing:
    """An agent in a task, over all kinds of worlds; or in all probes."""

    agent: str
    """Name of the agent in the table."""
    mapper: str
    """Name of its mapper, or `none`."""
    kinds: Sequence[Sequence[EpisodeResult]]
    """Its first episodes of each kind of worlds, or of each probe; as many of each."""
    is_short: bool
    """Whether these are fewer than the protocol asks for."""

    @cached_property
    def episodes(self) -> list[EpisodeResult]:
        """The episodes of all kinds."""
        return [one for some in self.kinds for one in some]

    @cached_property
    def figures(self) -> Mapping[str, Estimate]:
        """The figures, see `FIGURES`."""
        return estimate(self.episodes)

    def first(self, count: int) -> Standing:
        """Return it by the first episodes of each kind alone."""
        return replace(self, kinds=[some[:count] for some in self.kinds])


@dataclass(frozen=True, kw_only=True)
class Column:
    """A task in the table of agents, or all probes."""

    name: str
    """Short name of the task, or `PROBES`."""
    figure: str
    """The figure that is compared."""
    standings: Sequence[Standing]
    """The agents, the first one of the task first."""


def make_overview(results: Iterable[CellResults], protocol: Protocol) -> list[Column]:
    """Return the columns of the table of agents, with the protocol's first odometer.

    An agent stands in a column if it was run in all kinds of worlds in which the first agent of the
    task was, or, without that one, any agent.

    Args:
        results: The results of agents with their own mappers.
        protocol: The protocol.
    """
    columns: dict[str, dict[tuple[str, str], dict[tuple[str, str], CellResults]]] = {}
    for found in sorted(results, key=lambda found: protocol.order(found.cell)):
        cell = found.cell
        if cell.odometer == protocol.odometers[0] and found.episodes:
            name = PROBES if is_probe(cell.task) else cell.task
            its = columns.setdefault(name, {}).setdefault((cell.agent, cell.mapper), {})
            its[cell.task, cell.worlds] = found
    made = []
    for name, agents in columns.items():
        task = next(iter(next(iter(agents.values()))))[0]
        reference, figure = protocol.tasks[task].reference, protocol.tasks[task].figure
        first = [its for (agent, _), its in agents.items() if agent == reference]
        kinds = dict.fromkeys(kind for its in first or agents.values() for kind in its)
        standings = [
            _standing([its[kind] for kind in kinds], protocol)
            for its in agents.values()
            if {*kinds} <= {*its}
        ]
        standings.sort(key=lambda one: (one.agent != reference, one.agent, one.mapper))
        title = PROBES if name == PROBES else short_name(name)
        made.append(Column(name=title, figure=figure, standings=standings))
    return made


def _standing(cells: Sequence[CellResults], protocol: Protocol) -> Standing:
    count = min(len(found.episodes) for found in cells)
    asked = min(len(protocol.keys(found.cell.task, found.cell.worlds)) for found in cells)
    return Standing(
        agent=cells[0].cell.agent,
        mapper=cells[0].cell.mapper,
        kinds=[found.episodes[:count] for found in cells],
        is_short=count < asked,
    )


def agents_sentence(columns: Sequence[Column]) -> str:
    """Return which agents are first; an empty text where there are too few episodes."""
    said = [text for column in columns if column.name != PROBES for text in _first(column)]
    return f"First over all kinds of worlds: {'; '.join(said)}." if said else ""


def _first(column: Column) -> Iterator[str]:
    """Yield who is first in a task, of the agents that do not know the truth."""
    name = named(column.figure)
    known = [
        one
        for one in column.standings
        if one.agent not in _UPPER_BOUNDS and name in one.figures and len(one.episodes) >= FEWEST
    ]
    ranked = _in_the_same_episodes(known)
    if len(ranked) < 2:
        return
    ranked.sort(key=lambda one: (-one.figures[name].value, one.agent))
    best, second = ranked[:2]
    figure, left_out = FIGURES[name], len(known) - len(ranked)
    text = f"in {column.name} {agent_text(best.agent, best.mapper)} "
    text += f"({figure.title} {figure.form.format(best.figures[name].value)}, "
    text += f"{len(best.episodes):,} episodes"
    text += f"; {many(left_out, 'agent')} with fewer left out), " if left_out else "), "
    apart = compare(column.name, best.episodes, second.episodes, column.figure)
    if apart is None or apart.ci95[0] <= 0:
        yield f"{text}not told apart from {agent_text(second.agent, second.mapper)}"
    else:
        ahead = Estimate(value=apart.value, ci95=apart.ci95)
        by = written(ahead, "{:.3f}")
        yield f"{text}ahead of {agent_text(second.agent, second.mapper)} by {by}"


def _in_the_same_episodes(agents: Sequence[Standing]) -> list[Standing]:
    """Return agents by the same number of episodes of each kind.

    It is the one with which most episodes are compared in all: one agent of a few more does not end
    the comparison, and one of far fewer is left out.
    """
    counts = [len(one.kinds[0]) for one in agents]
    compared = {count: count * (sum(its >= count for its in counts) - 1) for count in counts}
    each = min(compared, key=lambda count: (-compared[count], count), default=0)
    return [one.first(each) for one, its in zip(agents, counts, strict=True) if its >= each]


def agents_lines(columns: Sequence[Column], odometer: str) -> Iterator[str]:
    """Yield the table of agents: a column a task; none without columns."""
    if not columns:
        return
    yield f"**Agents**, over all kinds of worlds, with the odometer `{odometer}`:"
    yield ""
    titles = [
        f"{column.name}: {' · '.join(FIGURES[name].title for name in SHORT[column.figure])}"
        for column in columns
    ]
    yield f"| agent | {' | '.join(titles)} |"
    yield "|---" * (len(titles) + 1) + "|"
    agents = dict.fromkeys(
        (one.agent, one.mapper) for column in columns for one in column.standings
    )
    for key in agents:
        cells = [
            next(
                (
                    figures_text(one.figures, len(one.episodes), SHORT[column.figure])
                    for one in column.standings
                    if (one.agent, one.mapper) == key
                ),
                "–",
            )
            for column in columns
        ]
        yield f"| {agent_text(*key)} | {' | '.join(cells)} |"
    counts = [
        _span([(len(one.episodes), one.is_short) for one in column.standings]) for column in columns
    ]
    yield f"| *episodes an agent* | {' | '.join(counts)} |"


def figures_text(figures: Mapping[str, Estimate], episodes: int, names: Sequence[str]) -> str:
    """Return figures in a cell of a table; the last one has its interval."""
    texts = [
        written(
            figures.get(name),
            FIGURES[name].form,
            interval=name == names[-1] and has_interval(episodes, name),
        )
        for name in names
    ]
    return " · ".join(texts)


def _span(counts: Iterable[tuple[int, bool]]) -> str:
    """Return numbers of episodes, the smallest to the largest; bold if some are too few."""
    counts = [(count, is_short) for count, is_short in counts if count]
    if not counts:
        return "–"
    numbers = sorted({count for count, _ in counts})
    text = f"{numbers[0]:,}" if len(numbers) == 1 else f"{numbers[0]:,}–{numbers[-1]:,}"
    return f"**{text}**" if any(is_short for _, is_short in counts) else text


def mappers_lines(report: MapperReport) -> Iterator[str]:
    """Yield the table of mappers under the first driver; none without rows."""
    if not report.rows:
        return
    driver = report.drivers[0]
    rows = [row for row in report.rows if row.driver == driver]
    odometers = list(dict.fromkeys(row.odometer for row in rows))
    of_mapper: dict[str, dict[str, MapperRow]] = {}
    for row in rows:
        of_mapper.setdefault(row.mapper, {})[row.odometer] = row
    first = odometers[0]
    yield f"**Mappers**, in offices: success in coming home under `{driver}` by odometers; and with"
    yield f"`{first}`, precision · recall of claims while exploring (none: the mapper never says"
    yield "that it knows the place), and in place recognition:"
    yield ""
    titles = [f"home, {odometer}" for odometer in odometers] + ["claims", "places"]
    titles += ["cost a reading (× `odometry`)"] * bool(report.costs)
    yield f"| mapper | {' | '.join(titles)} |"
    yield "|---" * (len(titles) + 1) + "|"
    for mapper, its in of_mapper.items():
        cells = [_home(its.get(odometer)) for odometer in odometers]
        cells += [_pair(its.get(first), name) for name in ("claims", "places")]
        cells += [cost_text(report.costs, mapper)] * bool(report.costs)
        yield f"| `{mapper}` | {' | '.join(cells)} |"
    counts = [
        _span((row.episodes, row.episodes < report.asked) for row in rows if row.odometer == name)
        for name in odometers
    ]
    ours = [row for row in rows if row.odometer == first]
    counts += [_span((row.claims, row.claims < report.asked) for row in ours)]
    counts += [_span((row.places, row.places < report.asked) for row in ours)]
    counts += ["–"] * bool(report.costs)
    yield f"| *episodes a mapper* | {' | '.join(counts)} |"


def _home(row: MapperRow | None) -> str:
    return "–" if row is None else written(row.figures.get("success_rate"), "{:.0%}")


def _pair(row: MapperRow | None, name: str) -> str:
    figures = {} if row is None else row.figures
    precision, recall = (figures.get(f"{name}_{each}") for each in ("precision", "recall"))
    if precision is None and recall is None:
        return "–"
    if precision is None and recall is not None and recall.value == 0.0:
        return "none"
    episodes = 0 if row is None else getattr(row, name)
    last = written(recall, "{:.0%}", interval=episodes > 1)
    return f"{written(precision, '{:.1%}', interval=False)} · {last}"


def overview_data(columns: Sequence[Column]) -> list[dict[str, Any]]:
    """Return what the table of agents shows as plain data."""
    return [
        {
            "column": column.name,
            "agent": one.agent,
            "mapper": one.mapper,
            "episodes": len(one.episodes),
            "figures": {
                name: {"value": found.value, "ci95": found.ci95}
                for name, found in one.figures.items()
            },
        }
        for column in columns
        for one in column.standings
    ]
