"""The folder of a benchmark: what was measured so far, a file a cell.

- `benchmark.json`: version of the protocol and of albot-env.
- `cells/TASK/WORLDS/ODOMETER/AGENT@MAPPER.jsonl`: a line that names the cell, then a line an
  episode, in the protocol's order.
- `agents/AGENT.json` and `agents/AGENT.yml`: facts of a trained agent, and its training plan.

A file is replaced as a whole, so a process that is killed leaves no half of one.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import albot_env
from albot_agents.benchmark.cell import Cell, EpisodeResult, read_episode
from albot_agents.benchmark.entrant import Entrant
from albot_agents.benchmark.protocol import LATEST, find_protocol, task_folder
from albot_agents.training.plan_file import save_plan
from albot_core.errors import InputError
from albot_core.files import is_left_over, make_folder, read_text, write_text
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
    "fingerprint": str | None, "protocol": int, "version": str,
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
    episodes: Sequence[EpisodeResult]
    """The episodes, in the protocol's order."""


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
            if self.path.is_dir() and any(self.path.iterdir()):
                expected = f"a new or an empty folder, or one with {_MANIFEST}"
                raise InputError(self.path, expected, "other files")
            return LATEST if version is None else version
        found = read_record(
            {"protocol": int, "version": str}, read_json(manifest), Location(manifest)
        )
        protocol = int(found["protocol"])
        if version not in (None, protocol):
            raise InputError(manifest, f"protocol {version}", str(protocol), place="protocol")
        _check_version(manifest, found["version"])
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
        with self._manifest.open("rb") as stream:
            if sys.platform != "win32":
                import fcntl

                try:  # The lock ends with the process, however it ends.
                    fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    expected = "a folder that no other process writes into"
                    raise InputError(self.path, expected, "one that does") from None
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
        name = f"{cell.agent}@{cell.mapper}{_SUFFIX}"
        return self.path / _CELLS / task_folder(cell.task) / cell.worlds / cell.odometer / name

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
        header |= {"protocol": self.protocol.protocol, "version": albot_env.__version__}
        order = {key: k for k, key in enumerate(self._keys(cell))}
        episodes = sorted(results.episodes, key=lambda one: order[one.world, one.seed])
        lines = [header, *(episode.to_plain() for episode in episodes)]
        file = self.file(cell)
        make_folder(file.parent)
        write_text(file, "".join(json.dumps(line, allow_nan=False) + "\n" for line in lines))

    def add(self, cell: Cell, fingerprint: str | None, episodes: Sequence[EpisodeResult]) -> None:
        """Add those episodes to a cell that it lacks.

        Raises:
            InputError: As `read` and `write`.
            OSError: The disk is full.
        """
        before = self.read_cell(cell)
        every = {
            (one.world, one.seed): one
            for one in (*episodes, *(() if before is None else before.episodes))
        }
        self.write(CellResults(cell=cell, fingerprint=fingerprint, episodes=list(every.values())))

    def write_agent(self, entrant: Entrant) -> None:
        """Keep what reproduces a trained agent: facts of its training, its mapper, its plan.

        Raises:
            InputError: They cannot be written.
        """
        name, file = entrant.name, entrant.entry.file
        assert file is not None, "a scripted agent has no training"
        folder = self.path / _AGENTS
        make_folder(folder)
        training = file.training
        facts: dict[str, Any]
        facts = {"task": file.task, "fingerprint": entrant.fingerprint, "samples": training.samples}
        plan = training.plan
        facts |= {"asked": plan.n_timesteps, "algorithm": plan.algorithm, "seed": plan.seed}
        facts |= {"command": training.command, "seconds": training.seconds}
        facts |= {"mapper": entrant.entry.mapper}
        save_plan(plan, folder / f"{name}.yml")
        write_text(folder / f"{name}.json", json.dumps(facts, indent=1) + "\n")

    def read_agents(self) -> dict[str, dict[str, Any]]:
        """Return the facts of all trained agents, by name.

        Raises:
            InputError: A file is damaged.
        """
        files = sorted((self.path / _AGENTS).glob("*.json"))
        return {file.stem: read_record(_FACTS, read_json(file), Location(file)) for file in files}

    def _keys(self, cell: Cell) -> list[tuple[str, int]]:
        return [(key.world, key.seed) for key in self.protocol.keys(cell.task, cell.worlds)]

    def _read_file(self, file: Path) -> CellResults:
        first, *lines = read_text(file).removesuffix("\n").split("\n")
        where = Location(file)
        header = read_record(_HEADER, _line(file, 1, first), where)
        if header.pop("protocol") != self.protocol.protocol:
            raise where.at("protocol").error(str(self.protocol.protocol), "another")
        _check_version(file, header.pop("version"))
        fingerprint = header.pop("fingerprint")
        cell = Cell(**header)
        known = self.protocol.tasks.get(cell.task)
        is_known = known is not None and cell.worlds in known.worlds
        is_known = is_known and cell.odometer in self.protocol.odometers
        if not is_known or file != self.file(cell):
            expected = f"the file of a cell of protocol {self.protocol.protocol}"
            raise InputError(file, expected, ", ".join(map(str, header.values())))
        episodes = [
            read_episode(_line(file, number, line), cell.agent, _line_location(file, number))
            for number, line in enumerate(lines, start=2)
        ]
        self._check_keys(file, cell, episodes)
        return CellResults(cell=cell, fingerprint=fingerprint, episodes=episodes)

    def _check_keys(self, file: Path, cell: Cell, episodes: Iterable[EpisodeResult]) -> None:
        """Raise InputError for an episode that is not in the protocol, or that is there twice."""
        left = set(self._keys(cell))
        for number, one in enumerate(episodes, start=2):
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


def _line_location(file: Path, number: int) -> Location:
    """Return the location of a line of a cell's file."""
    return Location(file, place=lambda path: f"line {number}, {dotted(path)}".rstrip(", "))


def _check_version(file: Path, version: str) -> None:
    """Raise InputError if figures were measured with another version of albot-env."""
    if version != albot_env.__version__:
        expected = f"figures of albot-env {albot_env.__version__}, or a new folder"
        raise InputError(file, expected, f"those of {version}", place="version")
