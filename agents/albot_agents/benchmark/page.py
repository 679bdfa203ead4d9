"""The page of results: it is generated from the table, whole."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import albot_env
from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.costs import read_costs
from albot_agents.benchmark.entrant import installed_sources
from albot_agents.benchmark.folder import CellResults, ResultsFolder
from albot_agents.benchmark.mapper_page import MapperReport, mapper_data, mapper_section, sentences
from albot_agents.benchmark.mappers import AGENTS as MAPPER_AGENTS
from albot_agents.benchmark.mappers import WORLDS, has_own_mapper
from albot_agents.benchmark.markdown import FEWEST, agent_text, paragraph, written
from albot_agents.benchmark.overview import (
    Column,
    agents_lines,
    agents_sentence,
    figures_text,
    make_overview,
    mappers_lines,
    overview_data,
)
from albot_agents.benchmark.protocol import Protocol
from albot_agents.benchmark.table import (
    FIGURES,
    SHORT,
    Estimate,
    TableRow,
    has_interval,
    make_table,
)
from albot_agents.evaluation import paired
from albot_agents.registry import BY_MAP, EXPLORE, PLACES, agent_names
from albot_agents.task import is_probe, short_name


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the page is made of."""

    protocol: Protocol
    """The protocol."""
    rows: Sequence[TableRow]
    """The figures of all cells, in order."""
    agents: Mapping[str, Mapping[str, Any]]
    """Facts of the trained agents, by name (`ResultsFolder.read_agents`)."""
    columns: Sequence[Column] = ()
    """The agents over all kinds of worlds, task by task."""
    mappers: MapperReport = field(default_factory=MapperReport)
    """The comparison of mappers."""
    picture: str | None = None
    """Path of its picture, relative to the page; None without one."""
    outdated: int = 0
    """Number of cells of another state of the agent or mapper than the installed one."""
    beside: Path | None = None
    """Folder of the page: what lies there is linked, the rest named; None for names alone."""

    @classmethod
    def of(cls, folder: ResultsFolder) -> Report:
        """Return the report of all that a folder has.

        Raises:
            InputError: A file is damaged, or two agents began the same episode at different poses.
        """
        costs, agents = read_costs(folder.path), folder.read_agents()
        return cls.of_results(folder.read(), folder.protocol, agents, costs)

    @classmethod
    def of_results(
        cls,
        results: Sequence[CellResults],
        protocol: Protocol,
        agents: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
        costs: Mapping[str, float] = MappingProxyType({}),
    ) -> Report:
        """Return the report of results.

        Args:
            results: The results.
            protocol: The protocol.
            agents: Facts of the trained agents, by name.
            costs: Cost a reading of mappers, in costs of `odometry`.

        Raises:
            InputError: Two agents began the same episode at different poses.
        """
        own = [found for found in results if has_own_mapper(found.cell, agents)]
        return cls(
            protocol=protocol,
            rows=make_table(own, protocol),
            columns=make_overview(own, protocol),
            agents=agents,
            mappers=MapperReport.of(results, protocol, costs),
            outdated=sum(
                installed_sources(found.cell, found.fingerprint) not in (None, found.sources)
                for found in results
            ),
        )

    def only(self, agents: Collection[str]) -> Report:
        """Return the report of some agents."""
        return replace(self, rows=[row for row in self.rows if row.cell.agent in agents])

    def rows_of(self, task: str) -> list[TableRow]:
        """Return the rows of a task."""
        return [row for row in self.rows if row.cell.task == task]

    def asked(self, cell: Cell) -> int:
        """Return the number of episodes that the protocol asks for in a cell."""
        return len(self.protocol.keys(cell.task, cell.worlds))

    def link(self, text: str, path: str) -> str:
        """Return a text that links a file, given relative to the page, if it is there."""
        found = self.beside is not None and (self.beside / path).is_file()
        return f"[{text}]({path})" if found else text

    @property
    def tasks(self) -> list[str]:
        """The tasks that have rows, in the protocol's order."""
        return list(dict.fromkeys(row.cell.task for row in self.rows))


Section = Callable[[Report], Iterable[str]]
"""Yields the lines of a section of the page; none if it has nothing to say."""


def render_page(report: Report, beside: Path | None = None) -> str:
    """Return the page in Markdown.

    Args:
        report: What it shows.
        beside: The folder in which it will lie; see `Report.beside`.
    """
    report = replace(report, beside=beside)
    sections = [[*section(report)] for section in SECTIONS]
    return "\n\n".join("\n".join(lines) for lines in sections if lines) + "\n"


def render_lines(report: Report) -> list[str]:
    """Return the lines of some agents (`Report.only`) for the tables of the page."""
    lines: list[str] = []
    for odometer in report.protocol.odometers:
        tables = list(_short_tables(report, odometer))
        lines += [f"odometer {odometer}:", *tables, ""] if tables else []
    for task in report.tasks:
        lines += _detailed_table(report.rows_of(task), report.protocol.tasks[task].figure)
        lines.append("")
    return lines


def page_data(report: Report) -> dict[str, Any]:
    """Return what the page shows as plain data, for programs."""
    rows = []
    for row in report.rows:
        figures = {name: asdict(estimate) for name, estimate in row.figures.items()}
        data = asdict(row.cell) | {"episodes": row.episodes, "figures": figures}
        rows.append(
            data | {"difference": None if row.difference is None else asdict(row.difference)}
        )
    return {
        "protocol": report.protocol.protocol,
        "version": albot_env.__version__,
        "agents": {name: _facts(facts, report.protocol) for name, facts in report.agents.items()},
        "sentences": said_of(report),
        "overview": overview_data(report.columns),
        "rows": rows,
        "mappers": mapper_data(report.mappers),
    }


def _facts(facts: Mapping[str, Any], protocol: Protocol) -> dict[str, Any]:
    return {**facts, "budget": protocol.budget(facts["asked"])}


def _overview(report: Report) -> Iterator[str]:
    """Yield what the figures show, the two tables, and the picture of the mappers."""
    yield "# Results"
    yield from paragraph(" ".join(said_of(report)))
    tables = agents_lines(report.columns, report.protocol.odometers[0])
    for lines in ([*tables], [*mappers_lines(report.mappers)]):
        if lines:
            yield ""
            yield from lines
    if report.picture is not None:
        yield ""
        yield f"![success in coming home against what the map was like]({report.picture})"


def said_of(report: Report) -> list[str]:
    """Return what the figures show, three sentences, as far as there are enough episodes."""
    said = [agents_sentence(report.columns), *sentences(report.mappers)]
    return [sentence for sentence in said if sentence]


def _opening(report: Report) -> Iterator[str]:
    protocol = report.protocol
    yield from paragraph(
        f"The albot-env benchmark, protocol {protocol.protocol} "
        f"({report.link('benchmark.md', 'benchmark.md')}), "
        f"measured with albot-env {albot_env.__version__}. Its worlds and seeds are for this page "
        "alone, not for training or tuning. All agents of a task meet the same episodes. In "
        "brackets: 95 % intervals. All of this page is generated by `albot results`."
    )
    counts = _episode_counts(report)
    short = [count for cell, count in counts.items() if count < report.asked(cell)]
    if short:
        asked = " or ".join(map(str, sorted({report.asked(cell) for cell in counts})))
        yield from paragraph(
            f"**Not complete:** {len(short):,} of {len(counts):,} cells have fewer episodes than "
            f"the {asked} that the protocol asks for, the smallest has {min(short)}. In rows with "
            "such cells that number is in bold. No sentence is made of fewer than "
            f"{FEWEST} episodes."
        )
    if report.outdated:
        yield from paragraph(
            f"**Of other sources:** {report.outdated:,} cells were measured with another state of "
            "their agent or mapper than the installed one."
        )


def _episode_counts(report: Report) -> dict[Cell, int]:
    """Return the number of episodes of each cell, those of the mappers' section among them."""
    counts = {row.cell: row.episodes for row in report.rows}
    for row in report.mappers.rows:
        for task, agent, episodes in (
            (BY_MAP, row.driver, row.episodes),
            (EXPLORE, MAPPER_AGENTS[EXPLORE], row.claims),
            (PLACES, MAPPER_AGENTS[PLACES], row.places),
        ):
            cell = Cell(
                task=task, agent=agent, mapper=row.mapper, odometer=row.odometer, worlds=WORLDS
            )
            if episodes:
                counts[cell] = episodes
    return counts


def _agents_table(report: Report) -> Iterator[str]:
    first = report.protocol.odometers[0]
    tables = list(_short_tables(report, first))
    if not tables:
        return
    yield "## Agents by worlds"
    yield ""
    others = "; others are [below](#odometers)" if _other_odometers(report) else ""
    yield f"With the odometer `{first}`{others}. A row is an agent, with its mapper in brackets."
    yield from tables


def _mappers(report: Report) -> Iterator[str]:
    yield from mapper_section(report.mappers)


def _other_odometers(report: Report) -> list[str]:
    measured = {row.cell.odometer for row in report.rows}
    return [odometer for odometer in report.protocol.odometers[1:] if odometer in measured]


def _odometers(report: Report) -> Iterator[str]:
    others = _other_odometers(report)
    if not others:
        return
    yield "## Odometers"
    for odometer in others:
        yield ""
        yield f"With the odometer `{odometer}`:"
        yield from _short_tables(report, odometer)


def _short_tables(report: Report, odometer: str) -> Iterator[str]:
    """Yield a table a task, worlds as columns; and one for all probes, probes as columns."""
    for task in report.tasks:
        rows = [] if is_probe(task) else report.rows_of(task)
        kinds = {kind: kind for kind in report.protocol.tasks[task].worlds}
        figure = report.protocol.tasks[task].figure
        yield from _short_table(
            report, task, rows, odometer, kinds, figure, lambda cell: cell.worlds
        )
    probes = [task for task in report.tasks if is_probe(task)]
    if probes:
        rows = [row for row in report.rows if row.cell.task in probes]
        names = {task: short_name(task).removeprefix("probe-") for task in probes}
        yield from _short_table(
            report, "Probes", rows, odometer, names, "success", lambda cell: cell.task
        )


def _short_table(
    report: Report,
    title: str,
    rows: Sequence[TableRow],
    odometer: str,
    columns: Mapping[str, str],
    figure: str,
    column_of: Callable[[Cell], str],
) -> Iterator[str]:
    by_agent = _by_agent(rows, odometer, column_of)
    if not by_agent:
        return
    shown = {
        key: name for key, name in columns.items() if any(key in its for its in by_agent.values())
    }
    names = SHORT[figure]
    titles = [FIGURES[name].title for name in names]
    yield ""
    yield f"**{title}**: {' · '.join(titles)}{' (95 % interval)' if names else ''}"
    yield ""
    yield f"| agent | budget | {' | '.join(shown.values())} | episodes a cell |"
    yield "|---" * (len(shown) + 3) + "|"
    for (agent, mapper), its in by_agent.items():
        cells = [
            figures_text(its[key].figures, its[key].episodes, names) if key in its else "–"
            for key in shown
        ]
        fewest = min(row.episodes for row in its.values())
        short = any(row.episodes < report.asked(row.cell) for row in its.values())
        number = f"**{fewest}**" if short else f"{fewest}"
        row = [agent_text(agent, mapper), _samples(report, agent), *cells, number]
        yield f"| {' | '.join(row)} |"


def _by_agent(
    rows: Sequence[TableRow],
    odometer: str,
    column_of: Callable[[Cell], str] = lambda cell: cell.worlds,
) -> dict[tuple[str, str], dict[str, TableRow]]:
    """Return the rows with an odometer by agent and mapper, then by column."""
    found: dict[tuple[str, str], dict[str, TableRow]] = {}
    for row in rows:
        if row.cell.odometer == odometer:
            found.setdefault((row.cell.agent, row.cell.mapper), {})[column_of(row.cell)] = row
    return found


def _samples(report: Report, agent: str) -> str:
    """Return the budget under which a trained agent is filed."""
    facts = report.agents.get(agent)
    if facts is None:
        return "–"
    budget = report.protocol.budget(facts["asked"])
    return "more" if budget is None else f"{budget / 1e6:g} M"


def _details(report: Report) -> Iterator[str]:
    if not report.rows:
        return
    yield "## All figures"
    yield from paragraph(
        "The last column is the mean difference from the first agent of the task, episode by "
        "episode. A dash: no figure, such as the precision of an agent that claims nothing. "
        f"{report.link('environments.md', 'environments.md')} explains the columns."
    )
    for task in report.tasks:
        rows = report.rows_of(task)
        yield ""
        yield f"<details><summary>{task}</summary>"
        yield ""
        yield from _detailed_table(rows, report.protocol.tasks[task].figure)
        yield ""
        yield "</details>"


def _detailed_table(rows: Sequence[TableRow], figure: str) -> Iterator[str]:
    names = [name for name in FIGURES if any(name in row.figures for row in rows)]
    titles = [FIGURES[name].title for name in names]
    titles.append(f"{paired.FIGURES[figure]} less the first's")
    yield f"| worlds | odometer | agent | episodes | {' | '.join(titles)} |"
    yield "|---" * (4 + len(titles)) + "|"
    for row in rows:
        cells = [row.cell.worlds, row.cell.odometer, agent_text(row.cell.agent, row.cell.mapper)]
        cells.append(str(row.episodes))
        cells += [
            written(
                row.figures.get(name), FIGURES[name].form, interval=has_interval(row.episodes, name)
            )
            for name in names
        ]
        told = row.difference
        apart = None if told is None else Estimate(value=told.value, ci95=told.ci95)
        several = told is not None and told.episodes > 1
        cells.append(written(apart, "{:+.2f}", interval=several))
        yield f"| {' | '.join(cells)} |"


def _trained(report: Report) -> Iterator[str]:
    if not report.agents:
        return
    yield "## How the trained agents were trained"
    yield from paragraph(
        "A row is reproduced by the agent's plan, which is in its card and, for `albot train`, in "
        "`agents/NAME.yml` of the folder of results."
    )
    yield ""
    yield "| agent | task | algorithm | seed | samples | budget | hours | command | fingerprint |"
    yield "|---" * 9 + "|"
    for name, facts in report.agents.items():
        called = f"`{name}`"
        if name in agent_names():
            called = report.link(called, f"../agents/albot_agents/trained/{name}.md")
        cells = [called, facts["task"], facts["algorithm"], str(facts["seed"])]
        cells += [f"{facts['samples']:,}", _samples(report, name), f"{facts['seconds'] / 3600:.1f}"]
        cells += [f"`{facts['command']}`", f"`{facts['fingerprint'][:8]}`"]
        yield f"| {' | '.join(cells)} |"


SECTIONS: tuple[Section, ...] = (
    _overview, _opening, _agents_table, _mappers, _odometers, _trained, _details,
)  # fmt: skip
"""The sections of the page, in order."""
