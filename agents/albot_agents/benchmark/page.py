"""The page of results: it is generated from the table, whole."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import albot_env
from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.costs import read_costs
from albot_agents.benchmark.folder import ResultsFolder
from albot_agents.benchmark.mapper_page import MapperReport, mapper_data, mapper_section
from albot_agents.benchmark.mappers import WORLDS, has_own_mapper
from albot_agents.benchmark.markdown import FEWEST, paragraph, written
from albot_agents.benchmark.protocol import Protocol
from albot_agents.benchmark.table import FIGURES, Estimate, TableRow, make_table
from albot_agents.evaluation import paired
from albot_agents.registry import AGENTS, BY_MAP, agent_names
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
    mappers: MapperReport = field(default_factory=MapperReport)
    """The comparison of mappers."""
    picture: str | None = None
    """Path of its picture, relative to the page; None without one."""
    beside: Path | None = None
    """Folder of the page: what lies there is linked, the rest named; None for names alone."""

    @classmethod
    def of(cls, folder: ResultsFolder) -> Report:
        """Return the report of all that a folder has.

        Raises:
            InputError: A file is damaged, or two agents began the same episode at different poses.
        """
        results, protocol = folder.read(), folder.protocol
        agents = folder.read_agents()
        own = [found for found in results if has_own_mapper(found.cell, agents)]
        return cls(
            protocol=protocol,
            rows=make_table(own, protocol),
            agents=agents,
            mappers=MapperReport.of(results, protocol, read_costs(folder.path)),
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

_SHORT: Mapping[str, tuple[str, ...]] = {
    "spl": ("success_rate", "spl"),
    "success": ("success_rate",),
    "coverage_auc": ("coverage_auc",),
    "recall": ("precision", "recall"),
}
"""What a cell of a short table shows, by the figure that the protocol compares; the last one has
its interval."""
_UPPER_BOUNDS = tuple(
    name for name, entry in AGENTS.items() if entry.make(entry.configs).knows_truth
)
"""Agents that know the truth."""


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
        "rows": rows,
        "mappers": mapper_data(report.mappers),
    }


def _facts(facts: Mapping[str, Any], protocol: Protocol) -> dict[str, Any]:
    return {**facts, "budget": protocol.budget(facts["asked"])}


def _opening(report: Report) -> Iterator[str]:
    protocol = report.protocol
    yield "# Results"
    yield from paragraph(
        f"The albot-env benchmark, protocol {protocol.protocol} "
        f"({report.link('benchmark.md', 'benchmark.md')}), "
        f"measured with albot-env {albot_env.__version__}. Its worlds and seeds are for this page "
        "alone, not for training or tuning. All agents of a task meet the same episodes. In "
        "brackets: 95 % intervals. All of this page is generated by `albot results`."
    )
    yield from paragraph(" ".join(_says(report)))
    counts = _episode_counts(report)
    short = [count for cell, count in counts.items() if count < report.asked(cell)]
    if short:
        asked = " or ".join(map(str, sorted({report.asked(cell) for cell in counts})))
        yield from paragraph(
            f"**Not complete:** {len(short):,} of {len(counts):,} cells have fewer episodes than "
            f"the {asked} that the protocol asks for, the smallest has {min(short)}. In rows with "
            "such cells that number is in bold."
        )


def _episode_counts(report: Report) -> dict[Cell, int]:
    """Return the number of episodes of each cell, those of the mappers' section among them."""
    counts = {row.cell: row.episodes for row in report.rows}
    for row in report.mappers.rows:
        cell = Cell(
            task=BY_MAP,
            agent=row.driver,
            mapper=row.mapper,
            odometer=row.odometer,
            worlds=WORLDS,
        )
        counts[cell] = row.episodes
    return counts


def _says(report: Report) -> Iterator[str]:
    """Yield a sentence about each task: the best agents over all kinds of worlds."""
    for task in report.tasks:
        measured = report.protocol.tasks[task]
        if is_probe(task):
            continue
        by_agent = _by_agent(report.rows_of(task), report.protocol.odometers[0])
        ranked = {
            (agent, mapper): its
            for (agent, mapper), its in by_agent.items()
            if agent not in _UPPER_BOUNDS
            and {*its} == {*measured.worlds}
            and all(_compared(row, measured.figure) is not None for row in its.values())
        }
        # Only agents that were measured in as many episodes are set beside each other.
        fewest = {key: min(row.episodes for row in its.values()) for key, its in ranked.items()}
        count = max(fewest.values(), default=0)
        ranked = {key: its for key, its in ranked.items() if fewest[key] == count >= FEWEST}
        if len(ranked) < 2:
            continue
        means: dict[str, float] = {}
        for key, its in ranked.items():
            values = [_compared(row, measured.figure) or 0.0 for row in its.values()]
            means[_called(*key)] = sum(values) / len(values)
        title = FIGURES[_named(measured.figure)].title
        best, second = sorted(means, key=lambda name: -means[name])[:2]
        rows = [row for its in ranked.values() for row in its.values()]
        short = any(row.episodes < report.asked(row.cell) for row in rows)
        so_far = f", by at least {count} episodes in each" if short else ""
        yield (
            f"In {short_name(task)}, {best} is first: its mean {title} over the "
            f"{len(measured.worlds)} kinds of worlds is {means[best]:.2f}, that of {second} "
            f"{means[second]:.2f}{so_far}."
        )


def _named(figure: str) -> str:
    """Return the name in the table of a figure of `paired`."""
    return {"success": "success_rate"}.get(figure, figure)


def _compared(row: TableRow, figure: str) -> float | None:
    found = row.figures.get(_named(figure))
    return None if found is None else found.value


def _agents_table(report: Report) -> Iterator[str]:
    first = report.protocol.odometers[0]
    tables = list(_short_tables(report, first))
    if not tables:
        return
    yield "## Agents"
    yield ""
    others = "; others are [below](#odometers)" if _other_odometers(report) else ""
    yield f"With the odometer `{first}`{others}. A row is an agent, with its mapper in brackets."
    yield from tables


def _mappers(report: Report) -> Iterator[str]:
    yield from mapper_section(report.mappers, report.picture)


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
    names = _SHORT[figure]
    titles = [FIGURES[name].title for name in names]
    yield ""
    yield f"**{title}**: {' · '.join(titles)}{' (95 % interval)' if names else ''}"
    yield ""
    yield f"| agent | budget | {' | '.join(shown.values())} | episodes a cell |"
    yield "|---" * (len(shown) + 3) + "|"
    for (agent, mapper), its in by_agent.items():
        cells = [_short_cell(its[key], names) if key in its else "–" for key in shown]
        fewest = min(row.episodes for row in its.values())
        short = any(row.episodes < report.asked(row.cell) for row in its.values())
        number = f"**{fewest}**" if short else f"{fewest}"
        row = [_called(agent, mapper), _samples(report, agent), *cells, number]
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


def _called(agent: str, mapper: str) -> str:
    return f"`{agent}`" if mapper == "none" else f"`{agent}` ({mapper})"


def _samples(report: Report, agent: str) -> str:
    """Return the budget under which a trained agent is filed."""
    facts = report.agents.get(agent)
    if facts is None:
        return "–"
    budget = report.protocol.budget(facts["asked"])
    return "more" if budget is None else f"{budget / 1e6:g} M"


def _short_cell(row: TableRow, names: Sequence[str]) -> str:
    texts = [
        written(
            row.figures.get(name),
            FIGURES[name].form,
            interval=name == names[-1] and _has_intervals(row, name),
        )
        for name in names
    ]
    return " · ".join(texts)


def _has_intervals(row: TableRow, name: str) -> bool:
    """Return whether a figure's interval says something: one episode is not resampled."""
    return row.episodes > 1 or name == "success_rate"


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
        cells = [row.cell.worlds, row.cell.odometer, _called(row.cell.agent, row.cell.mapper)]
        cells.append(str(row.episodes))
        cells += [
            written(row.figures.get(name), FIGURES[name].form, interval=_has_intervals(row, name))
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
    _opening, _agents_table, _mappers, _odometers, _trained, _details,
)  # fmt: skip
"""The sections of the page, in order."""
