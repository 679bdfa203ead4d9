"""How long the episodes of each cell took, kept in the folder of a benchmark: `times.json`.

Processor times differ from machine to machine, and from run to run. So they are kept apart from the
episodes, and are on no page.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from albot_agents.benchmark.folder import ResultsFolder, cell_name
from albot_core.files import write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_config, read_record
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, check_fields

if TYPE_CHECKING:
    from albot_agents.benchmark.run import Row

_FILE = "times.json"


@dataclass(frozen=True, kw_only=True)
class Spent:
    """The time that some episodes of a cell took."""

    episodes: int
    """Number of the episodes."""
    seconds: float
    """Their processor time (s)."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "episodes")
        check_fields(self, NOT_NEGATIVE, "seconds")

    def __add__(self, other: Spent) -> Spent:
        """Return the time of both."""
        return Spent(episodes=self.episodes + other.episodes, seconds=self.seconds + other.seconds)

    def of(self, episodes: int) -> float:
        """Return the time that so many episodes take (s)."""
        return self.seconds / self.episodes * episodes


def read_times(folder: Path) -> dict[str, Spent]:
    """Return the times by the path of the cell's file; none without a file.

    Raises:
        InputError: The file is damaged.
    """
    file = folder / _FILE
    if not file.exists():
        return {}
    where = Location(file)
    found = read_record({"cells": dict[str, Any]}, read_json(file), where)
    cells: Mapping[str, Any] = found["cells"]
    return {name: read_config(Spent, data, where.at("cells", name)) for name, data in cells.items()}


def add_times(folder: Path, spent: Iterable[tuple[str, Spent]]) -> None:
    """Add to the times that the folder has.

    Args:
        folder: The folder.
        spent: Paths of cells' files, and the time of their episodes.

    Raises:
        InputError: The file is damaged, or cannot be written.
    """
    every = read_times(folder)
    for name, some in spent:
        every[name] = every[name] + some if name in every else some
    cells = {name: asdict(some) for name, some in sorted(every.items())}
    write_text(folder / _FILE, json.dumps({"cells": cells}, indent=1) + "\n")


@dataclass(frozen=True, kw_only=True)
class RowTime:
    """How long a row of the benchmark takes, as far as its cells were measured."""

    task: str
    """Id of the environment."""
    agent: str
    """Name of the agent in the table."""
    mapper: str
    """Name of its mapper, or `none`."""
    cells: int
    """Number of its cells."""
    episodes: int
    """Number of all of the protocol's episodes in them."""
    seconds: float
    """Processor time of all of these (s), from the mean of those that were run in each cell."""
    slowest: str
    """Worlds and odometer of the slowest cell."""
    slowest_seconds: float
    """Processor time of all of the protocol's episodes in that cell (s)."""


def row_times(folder: ResultsFolder, rows: Iterable[Row]) -> Iterator[RowTime]:
    """Yield how long each row takes of which episodes were timed in this folder.

    Raises:
        InputError: The file is damaged.
    """
    times = read_times(folder.path)
    for row in rows:
        timed = {
            cell: (len(folder.protocol.keys(cell.task, cell.worlds)), times[cell_name(cell)])
            for cell in row.cells
            if cell_name(cell) in times
        }
        if timed:
            taken = {cell: spent.of(count) for cell, (count, spent) in timed.items()}
            slowest = max(taken, key=lambda cell: taken[cell])
            yield RowTime(
                task=row.task,
                agent=row.entrant.name,
                mapper=row.entrant.mapper,
                cells=len(timed),
                episodes=sum(count for count, _ in timed.values()),
                seconds=sum(taken.values()),
                slowest=f"{slowest.worlds}, {slowest.odometer}",
                slowest_seconds=taken[slowest],
            )


def time_line(row: RowTime) -> str:
    """Return the time of a row in words."""
    return (
        f"{row.task} {row.agent} ({row.mapper}): the {row.episodes:,} episodes of {row.cells} "
        f"cells take {row.seconds:,.0f} s of processor time, those of the slowest cell "
        f"({row.slowest}) {row.slowest_seconds:,.0f} s"
    )
