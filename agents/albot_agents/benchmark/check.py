"""Run episodes again that a benchmark's folder has: are they the same here and now?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.folder import CellResults, ResultsFolder
from albot_agents.benchmark.run import BenchmarkRun, Measured, Row


@dataclass(frozen=True, kw_only=True)
class Difference:
    """An episode whose result was another when it was run again."""

    cell: Cell
    """Its cell."""
    world: str
    """The world's name in the protocol."""
    seed: int
    """Seed of environment and agent."""
    value: str
    """Name of the first value that differs."""
    kept: Any
    """The value in the folder."""
    found: Any
    """The value when it was run again."""

    @property
    def facts(self) -> dict[str, Any]:
        """It as plain data."""
        cell: dict[str, Any] = asdict(self.cell)
        apart = {"value": self.value, "kept": self.kept, "found": self.found}
        return cell | {"world": self.world, "seed": self.seed} | apart

    @property
    def text(self) -> str:
        """It as a line of text."""
        cell = self.cell
        return (
            f"differs: {cell.agent} with the mapper {cell.mapper} in {cell.task}, {cell.worlds}, "
            f"{cell.odometer}, {self.world}, seed {self.seed}: {self.value} {self.kept}, now "
            f"{self.found}"
        )


class BenchmarkCheck(BenchmarkRun):
    """The first episodes that a folder has of each cell of some rows, to be run again.

    Where all of a cell's are the same to the last digit, and the cell is of other sources than the
    installed ones, its results become those of the installed ones: an edit that changes no result,
    such as a rearrangement, need not cost the measurements of days.

    Args:
        folder: The folder.
        rows: The rows; cells that the folder lacks are left out.
        episodes: Number of episodes of each cell, at most those that the folder has.
        plans: The folder of the floor plans; None if no row needs it.

    Raises:
        InputError: As `BenchmarkRun`, but that sources may be others.
    """

    def __init__(
        self,
        folder: ResultsFolder,
        rows: Sequence[Row],
        episodes: int,
        plans: Path | None = None,
    ) -> None:
        self.same = 0
        """Number of episodes that were run again with the same result."""
        self.differences: list[Difference] = []
        """Those with another result."""
        self.adopted = 0
        """Number of cells of other sources that are now of the installed ones."""
        self._again = episodes
        self._kept: dict[Cell, CellResults] = {}
        super().__init__(folder, rows, None, plans)

    def take_stock(self, results: Iterable[CellResults], source: object = None) -> None:
        """Note what the folder has, or will have before the run: its first episodes are missing.

        Raises:
            InputError: Some are of another agent of a row's name.
        """
        found = list(results)
        super().take_stock(found, source)
        self._kept = {each.cell: each for each in found if each.cell in self._done}
        for cell, there in self._done.items():
            keys = [(key.world, key.seed) for key in self._keys(cell)]
            self._done[cell] = set(keys) - set([key for key in keys if key in there][: self._again])

    def _check_sources(self, found: CellResults, file: object) -> None:
        """Sources may be others: whether that matters is what is checked."""

    def _keep(self, measured: Sequence[Measured]) -> None:
        for one in measured:
            cell, episode = one.cell, one.episode
            kept = {(each.world, each.seed): each for each in self._kept[cell].episodes}
            apart = kept[episode.world, episode.seed].difference(episode)
            if apart is None:
                self.same += 1
            else:
                value, before, now = apart
                self.differences.append(
                    Difference(
                        cell=cell,
                        world=episode.world,
                        seed=episode.seed,
                        value=value,
                        kept=before,
                        found=now,
                    )
                )
            self._done[cell].add((episode.world, episode.seed))
            self._adopt(cell)

    def _adopt(self, cell: Cell) -> None:
        """Note the installed sources of a cell whose episodes are all checked, and the same."""
        found, sources = self._kept[cell], self._sources[cell.agent, cell.mapper]
        is_checked = len(self._done[cell]) == len(self._keys(cell))
        is_same = all(each.cell != cell for each in self.differences)
        if is_checked and is_same and found.sources != sources:
            self._folder.write(replace(found, sources=sources))
            self.adopted += 1
