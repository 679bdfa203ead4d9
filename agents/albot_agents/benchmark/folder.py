"""The folder of a benchmark: what was measured so far, a file a cell.

- `benchmark.json`: version of the protocol and of albot-env.
- `cells/TASK/WORLDS/ODOMETER/AGENT@MAPPER.jsonl`: a line that names the cell, then a line an
  episode, in the protocol's order.
- `agents/AGENT.json` and `agents/AGENT.yml`: facts of a trained agent, and its training plan.
- `costs.json` and `times.json`: see `costs` and `times`.

A file is replaced as a whole, so a process that is killed leaves no half of one.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import albot_env
from albot_agents.benchmark.cell import Cell, EpisodeResult, read_episode
from albot_agents.benchmark.entrant import Entrant
from albot_agents.benchmark.protocol import LATEST, Protocol, find_protocol, task_folder
from albot_agents.training.plan_file import plan_text
from albot_core.errors import InputError
from albot_core.files import is_left_over, make_folder, read_text, sole_writer, write_text
from albot_core.json_document import parse_json, read_json
from albot_core.plain_data import Location, read_record
from albot_core.yaml_document import dotted

_MANIFEST = "benchmark.json"
_CELLS = "cells"
_AGENTS = "agents"
_SUFFIX = ".jsonl"
_WRITTEN = (_SUFFIX, ".json", ".yml", ".md", ".png")
"""How the names of the files end that are written into the folder."""
_HEADER = {
    "task": str, "agent": str, "mapper": str, "odometer": str, "worlds": str,
    "fingerprint": str | None, "sources": str, "protocol": int, "version": str,
}  # fmt: skip
_FACTS = {
    "task": str, "fingerprint": str, "samples": int, "asked": int, "algorithm": str, "seed": int,
    "command": str, "seconds": float, "mapper": str,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CellResults:
    """What was measured in a cell so far."""

    cell: Cell
    """The cell."""
    fingerprint: str | None
    """`Entrant.fingerprint`: None for a scripted agent."""
    sources: str
    """`Entrant.sources`."""
    episodes: Sequence[EpisodeResult]
    """The episodes, in the protocol's order."""

    def add(self, other: CellResults, where: object, there: object) -> CellResults:
        """Return these results with others of the same cell.

        Args:
            other: The others.
            where: Where these are from, for errors.
            there: Where the others are from.

        Raises:
            InputError: The others are of another state of the agent or its mapper, or an episode
                has another result there.
        """
        for name in ("fingerprint", "sources"):
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                of = f"{self.cell.agent} with the mapper {self.cell.mapper} in {where}"
                raise InputError(there, f"the {name} {mine} of {of}", f"{its}")
        known = {(one.world, one.seed): one for one in self.episodes}
        for one in other.episodes:
            same = known.setdefault((one.world, one.seed), one)
            if (apart := same.difference(one)) is not None:
                cell = self.cell
                said = f"{cell.agent} with the mapper {cell.mapper} in {cell.task}, {cell.worlds}, "
                said += f"{cell.odometer}, {one.world}, seed {one.seed}"
                name, mine, its = apart
                expected = f"the result of {said} that is in {where}: {name} {mine}"
                raise InputError(there, expected, f"another: {its}")
        return replace(self, episodes=list(known.values()))


@dataclass(frozen=True, kw_only=True)
class AgentRecord:
    """What reproduces a trained agent."""

    facts: Mapping[str, Any]
    """Facts of its training, and its mapper; see `read_facts`."""
    plan: str
    """Its training plan in YAML."""


def read_facts(data: Any, where: Location) -> dict[str, Any]:
    """Parse the facts of a trained agent.

    Raises:
        InputError: They are none.
    """
    return read_record(_FACTS, data, where)


def cell_name(cell: Cell) -> str:
    """Return the path of a cell's file in the folder of cells, without its suffix."""
    return f"{task_folder(cell.task)}/{cell.worlds}/{cell.odometer}/{cell.agent}@{cell.mapper}"


class ResultsFolder:
    """The folder of a benchmark. It need not exist.

    Args:
        path: The folder.
        version: Version of the protocol; None for that of the folder, or the latest one.

    Raises:
        InputError: There is no such protocol, or the folder holds something else, or results of
            another protocol, or of another version of albot-env.
    """

    def __init__(self, path: Path, version: int | None = None) -> None:
        self.path = path
        self.protocol = find_protocol(self._check(version))

    @property
    def _manifest(self) -> Path:
        return self.path / _MANIFEST

    def _check(self, version: int | None) -> int:
        """Return the version of the protocol."""
        manifest = self._manifest
        if not manifest.exists():
            # What a killed process has left of the manifest is deleted by `locked`.
            if self.path.is_dir() and not all(
                is_left_over(path, _WRITTEN) for path in self.path.iterdir()
            ):
                expected = f"a new or an empty folder, or one with {_MANIFEST}"
                raise InputError(self.path, expected, "other files")
            return LATEST if version is None else version
        found = read_record(
            {"protocol": int, "version": str}, read_json(manifest), Location(manifest)
        )
        protocol = int(found["protocol"])
        if version not in (None, protocol):
            raise InputError(manifest, f"protocol {version}", str(protocol), place="protocol")
        check_version(manifest, found["version"])
        return protocol

    def begin(self) -> None:
        """Make the folder if it does not exist.

        Raises:
            InputError: It cannot be written.
        """
        make_folder(self.path)
        if not self._manifest.exists():
            facts = {"protocol": self.protocol.protocol, "version": albot_env.__version__}
            write_text(self._manifest, json.dumps(facts, indent=1) + "\n")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Let no other process write into the folder, which has begun, during the block.

        Delete what a killed process left.

        Raises:
            InputError: Another process writes into it.
        """
        with sole_writer(self._manifest, self.path):
            for left in self._left():
                left.unlink(missing_ok=True)
            yield

    def _left(self) -> list[Path]:
        """Return what killed processes left of files of this folder."""
        files = [*self.path.glob(".*"), *(self.path / _AGENTS).glob(".*")]
        files += (self.path / _CELLS).rglob(".*")
        return [file for file in files if is_left_over(file, _WRITTEN) and file.is_file()]

    def file(self, cell: Cell) -> Path:
        """Return the path of a cell's file."""
        return self.path / _CELLS / f"{cell_name(cell)}{_SUFFIX}"

    def read(self) -> list[CellResults]:
        """Return all that was measured so far.

        Raises:
            InputError: A file is damaged, or of another protocol or version.
        """
        files = sorted((self.path / _CELLS).rglob(f"*{_SUFFIX}"))
        return [self._read_file(file) for file in files]

    def read_cell(self, cell: Cell) -> CellResults | None:
        """Return what was measured in a cell; None if nothing was.

        Raises:
            InputError: As `read`.
        """
        file = self.file(cell)
        return self._read_file(file) if file.exists() else None

    def write(self, results: CellResults) -> None:
        """Replace the file of a cell.

        Raises:
            InputError: It cannot be written.
            OSError: The disk is full.
        """
        cell = results.cell
        header: dict[str, Any] = asdict(cell) | {"fingerprint": results.fingerprint}
        header |= {"sources": results.sources}
        header |= {"protocol": self.protocol.protocol, "version": albot_env.__version__}
        order = {key: k for k, key in enumerate(self._keys(cell))}
        episodes = sorted(results.episodes, key=lambda one: order[one.world, one.seed])
        lines = [header, *(episode.to_plain() for episode in episodes)]
        file = self.file(cell)
        make_folder(file.parent)
        write_text(file, "".join(json.dumps(line, allow_nan=False) + "\n" for line in lines))

    def add(self, results: CellResults, there: object = "the new results") -> None:
        """Add episodes to those of their cell.

        Args:
            results: The episodes.
            there: Where they are from, for errors.

        Raises:
            InputError: As `read`, `write` and `CellResults.add`.
            OSError: The disk is full.
        """
        before = self.read_cell(results.cell)
        if before is not None:
            results = before.add(results, self.file(results.cell), there)
        self.write(results)

    def write_agent(self, entrant: Entrant) -> None:
        """Keep what reproduces a trained agent: facts of its training, its mapper, its plan.

        Raises:
            InputError: They cannot be written.
        """
        name, file = entrant.name, entrant.entry.file
        assert file is not None, "a scripted agent has no training"
        training = file.training
        facts: dict[str, Any]
        facts = {"task": file.task, "fingerprint": entrant.fingerprint, "samples": training.samples}
        plan = training.plan
        facts |= {"asked": plan.n_timesteps, "algorithm": plan.algorithm, "seed": plan.seed}
        facts |= {"command": training.command, "seconds": training.seconds}
        facts |= {"mapper": entrant.entry.mapper}
        self.write_record(name, AgentRecord(facts=facts, plan=plan_text(plan)))

    def write_record(self, name: str, record: AgentRecord) -> None:
        """Keep what reproduces a trained agent.

        Raises:
            InputError: It cannot be written.
        """
        folder = self.path / _AGENTS
        make_folder(folder)
        write_text(folder / f"{name}.yml", record.plan)
        write_text(folder / f"{name}.json", json.dumps(record.facts, indent=1) + "\n")

    def read_agents(self) -> dict[str, dict[str, Any]]:
        """Return the facts of all trained agents, by name.

        Raises:
            InputError: A file is damaged.
        """
        files = sorted((self.path / _AGENTS).glob("*.json"))
        return {file.stem: read_facts(read_json(file), Location(file)) for file in files}

    def read_records(self) -> dict[str, AgentRecord]:
        """Return what reproduces each trained agent, by name.

        Raises:
            InputError: A file is damaged or missing.
        """
        return {
            name: AgentRecord(facts=facts, plan=read_text(self.path / _AGENTS / f"{name}.yml"))
            for name, facts in self.read_agents().items()
        }

    def _keys(self, cell: Cell) -> list[tuple[str, int]]:
        return [(key.world, key.seed) for key in self.protocol.keys(cell.task, cell.worlds)]

    def _read_file(self, file: Path) -> CellResults:
        first, *lines = read_text(file).removesuffix("\n").split("\n")
        where = Location(file)
        header = read_record(_HEADER, _line(file, 1, first), where)
        if header.pop("protocol") != self.protocol.protocol:
            raise where.at("protocol").error(str(self.protocol.protocol), "another")
        check_version(file, header.pop("version"))
        fingerprint, sources = header.pop("fingerprint"), header.pop("sources")
        cell = Cell(**header)
        if not self.protocol.has(cell) or file != self.file(cell):
            expected = f"the file of a cell of protocol {self.protocol.protocol}"
            raise InputError(file, expected, ", ".join(map(str, header.values())))
        episodes = [
            read_episode(_line(file, number, line), cell.agent, line_location(file, number))
            for number, line in enumerate(lines, start=2)
        ]
        check_keys(self.protocol, cell, zip(count(2), episodes, strict=False), file)
        return CellResults(cell=cell, fingerprint=fingerprint, sources=sources, episodes=episodes)


def check_keys(
    protocol: Protocol,
    cell: Cell,
    episodes: Iterable[tuple[int, EpisodeResult]],
    file: Path,
) -> None:
    """Raise InputError for an episode that is not in the protocol, or that is there twice.

    Args:
        protocol: The protocol.
        cell: The cell of the episodes.
        episodes: Their lines in the file, and they.
        file: The file.
    """
    left = {(key.world, key.seed) for key in protocol.keys(cell.task, cell.worlds)}
    for number, one in episodes:
        if (one.world, one.seed) not in left:
            expected = "an episode of the protocol, once"
            raise InputError(
                file, expected, f"{one.world}, seed {one.seed}", place=f"line {number}"
            )
        left.remove((one.world, one.seed))


def _line(file: Path, number: int, text: str) -> Any:
    """Parse a line of a cell's file."""
    try:
        return parse_json(text, file, f"line {number}")
    except InputError as error:
        expected = f"{error.expected}; remove a torn file to measure its cell again"
        raise InputError(file, expected, error.found, place=error.place) from None


def line_location(file: Path, number: int) -> Location:
    """Return the location of a line of a file of lines of JSON."""
    return Location(file, place=lambda path: f"line {number}, {dotted(path)}".rstrip(", "))


def check_version(file: Path, version: str) -> None:
    """Raise InputError if figures were measured with another version of albot-env."""
    if version != albot_env.__version__:
        expected = f"figures of albot-env {albot_env.__version__}, or a new folder"
        raise InputError(file, expected, f"those of {version}", place="version")
