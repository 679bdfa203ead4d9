"""The results of a benchmark in one file: a line an episode, gzipped JSON Lines.

The first line holds what is true of all: the protocol's version and digest, the version of
albot-env, the number of episodes, facts and plans of the trained agents, and the costs of mappers.
Each other line is an episode with its cell, and with what determines it besides: the fingerprint
of a trained agent, and the digest of the sources of agent and mapper. The same results give the
same bytes. Files, and folders of results, can be added to a folder (`merge`), so that runs on
several machines or days add up.
"""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import albot_env
from albot_agents.benchmark.cell import Cell, EpisodeResult, read_episode
from albot_agents.benchmark.costs import add_costs, read_costs
from albot_agents.benchmark.folder import (
    AgentRecord,
    CellResults,
    ResultsFolder,
    check_keys,
    check_version,
    line_location,
    read_facts,
)
from albot_agents.benchmark.protocol import Protocol
from albot_core.errors import InputError
from albot_core.files import atomic_write, read_text
from albot_core.json_document import parse_json
from albot_core.plain_data import Location, read_record
from albot_core.yaml_document import format_value

SUFFIX = ".jsonl.gz"
"""How the names of such files end."""
_HEADER = {
    "protocol": int, "digest": str, "version": str, "episodes": int, "agents": dict[str, Any],
    "costs": dict[str, float],
}  # fmt: skip
_CELL = {
    "task": str, "agent": str, "mapper": str, "odometer": str, "worlds": str,
    "fingerprint": str | None, "sources": str,
}  # fmt: skip
_RECORD = {"facts": Any, "plan": str}
_LONGEST_NAME = 100
"""Most characters of the name of an agent or a mapper."""


@dataclass(frozen=True, kw_only=True)
class Results:
    """All that a folder, or a file, has of a benchmark."""

    source: Path
    """The folder or file."""
    cells: Mapping[Cell, CellResults]
    """The episodes."""
    agents: Mapping[str, AgentRecord] = field(default_factory=dict)
    """The trained agents, by name."""
    costs: Mapping[str, float] = field(default_factory=dict)
    """Cost a reading of mappers, in costs of `odometry`."""

    @classmethod
    def of(cls, folder: ResultsFolder) -> Results:
        """Return all that a folder has.

        Raises:
            InputError: A file is damaged.
        """
        return cls(
            source=folder.path,
            cells={found.cell: found for found in folder.read() if found.episodes},
            agents=folder.read_records(),
            costs=read_costs(folder.path),
        )

    def add(self, other: Results) -> Results:
        """Return these results with those of another source.

        Of costs, which no two runs measure alike, these stand before the other's.

        Raises:
            InputError: An episode has another result there, or an agent of the same name is
                another one there.
        """
        cells, agents = dict(self.cells), dict(self.agents)
        for cell, found in other.cells.items():
            mine = cells.get(cell)
            cells[cell] = found if mine is None else mine.add(found, self.source, other.source)
        for name, record in other.agents.items():
            if agents.setdefault(name, record) != record:
                expected = f"the training of {name} that is in {self.source}"
                raise InputError(other.source, expected, "another")
        return replace(self, cells=cells, agents=agents, costs={**other.costs, **self.costs})

    def write(self, folder: ResultsFolder) -> None:
        """Write them into a folder that has nothing else, or a part of them.

        Raises:
            InputError: It cannot be written, or another process writes into it.
            OSError: The disk is full.
        """
        folder.begin()
        with folder.locked():
            for found in self.cells.values():
                folder.add(found, self.source)
            for name, record in self.agents.items():
                folder.write_record(name, record)
            if self.costs:
                add_costs(folder.path, self.costs)


def read_results(path: Path, protocol: Protocol) -> Results:
    """Read a folder of results, or a file of `write_rows`.

    Args:
        path: The folder or file.
        protocol: The protocol that they must be of.

    Raises:
        InputError: It is damaged, of another protocol or version of albot-env, or has an episode
            twice or one that is not the protocol's.
    """
    if not path.is_dir():
        return _read_rows(path, protocol)
    if not (path / "benchmark.json").exists():
        raise InputError(path, "a folder of results, with benchmark.json", "another")
    return Results.of(ResultsFolder(path, protocol.protocol))


def merge(results: Iterable[Results]) -> Results:
    """Return the results of several sources together.

    Raises:
        InputError: As `Results.add`.
    """
    first, *others = results
    for other in others:
        first = first.add(other)
    return first


def write_rows(results: Results, protocol: Protocol, file: Path) -> None:
    """Write results into a file, as the module says.

    Raises:
        InputError: The file cannot be written.
        OSError: The disk is full.
    """
    cells = [results.cells[cell] for cell in sorted(results.cells, key=protocol.order)]
    header = {
        "protocol": protocol.protocol,
        "digest": protocol.digest,
        "version": albot_env.__version__,
        "episodes": sum(len(found.episodes) for found in cells),
        "agents": {name: asdict(results.agents[name]) for name in sorted(results.agents)},
        "costs": dict(sorted(results.costs.items())),
    }
    rows = (
        asdict(found.cell)
        | {"fingerprint": found.fingerprint, "sources": found.sources}
        | one.to_plain()
        for found in cells
        for one in found.episodes
    )
    packed = io.BytesIO()
    # Neither name nor time, so that the same results give the same bytes.
    with gzip.GzipFile(filename="", mode="wb", fileobj=packed, mtime=0) as stream:
        for line in (header, *rows):
            text = json.dumps(line, allow_nan=False, separators=(",", ":"))
            stream.write(f"{text}\n".encode())
    with atomic_write(file) as out:
        out.write(packed.getvalue())


def _read_rows(file: Path, protocol: Protocol) -> Results:
    first, *lines = read_text(file).removesuffix("\n").split("\n")
    where = line_location(file, 1)
    data = parse_json(first, file, "line 1")
    header = read_record(_HEADER, data, where)
    for name in ("protocol", "digest"):
        if header[name] != getattr(protocol, name):
            expected = f"results of protocol {protocol.protocol}, {name} {getattr(protocol, name)}"
            raise where.at(name).error(expected, str(header[name]))
    check_version(file, header["version"])
    if len(lines) != header["episodes"]:
        expected = f"{header['episodes']} episodes, a line each"
        raise InputError(file, expected, f"{len(lines)}: the file is torn")
    rows = [_read_row(line, protocol, file, number) for number, line in enumerate(lines, start=2)]
    return Results(
        source=file,
        cells=_by_cell(rows, protocol, file),
        agents={
            name: _read_record(name, each, where.at("agents", name))
            for name, each in header["agents"].items()
        },
        costs=header["costs"],
    )


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A line of the file."""

    number: int
    cell: Cell
    fingerprint: str | None
    sources: str
    episode: EpisodeResult


def _read_row(line: str, protocol: Protocol, file: Path, number: int) -> _Row:
    where = line_location(file, number)
    data = parse_json(line, file, f"line {number}")
    if not isinstance(data, dict):
        raise where.error("an episode", format_value(data))
    head = read_record(_CELL, {name: data.pop(name) for name in _CELL if name in data}, where)
    fingerprint, sources = head.pop("fingerprint"), head.pop("sources")
    cell = Cell(**head)
    for name in ("agent", "mapper"):
        _check_name(head[name], where.at(name))
    if not protocol.has(cell):
        expected = f"a cell of protocol {protocol.protocol}"
        raise where.error(expected, ", ".join(map(str, head.values())))
    episode = read_episode(data, cell.agent, where)
    return _Row(number=number, cell=cell, fingerprint=fingerprint, sources=sources, episode=episode)


def _by_cell(rows: Sequence[_Row], protocol: Protocol, file: Path) -> dict[Cell, CellResults]:
    of_cells: dict[Cell, list[_Row]] = {}
    for row in rows:
        of_cells.setdefault(row.cell, []).append(row)
    cells = {}
    for cell, some in of_cells.items():
        first = some[0]
        for row in some:
            for name in ("fingerprint", "sources"):
                wanted, found = getattr(first, name), getattr(row, name)
                if wanted != found:
                    where = line_location(file, row.number).at(name)
                    raise where.error(f"{wanted}, as in line {first.number}", str(found))
        check_keys(protocol, cell, ((row.number, row.episode) for row in some), file)
        order = {
            (key.world, key.seed): k for k, key in enumerate(protocol.keys(cell.task, cell.worlds))
        }
        cells[cell] = CellResults(
            cell=cell,
            fingerprint=first.fingerprint,
            sources=first.sources,
            episodes=sorted(
                (row.episode for row in some), key=lambda one: order[one.world, one.seed]
            ),
        )
    return cells


def _read_record(name: str, data: Any, where: Location) -> AgentRecord:
    _check_name(name, where)
    found = read_record(_RECORD, data, where)
    return AgentRecord(facts=read_facts(found["facts"], where.at("facts")), plan=found["plan"])


def _check_name(name: str, where: Location) -> None:
    """Raise InputError for a name that cannot be part of a file's name."""
    fits = 0 < len(name) <= _LONGEST_NAME and name.isprintable() and not set(name) & {"/", "\\"}
    if not fits or name.startswith("."):
        raise where.error("a name that a file can have", format_value(name))
