"""Run the episodes that a benchmark's folder lacks.

Episodes in one world with one seed run one after another in the same process. Where agents begin
after a journey, they drive the same way, which is then found once; and agents with the same mapper
and sensors make the same journey, which is then made once (`journeys`). Episodes of a trained
agent in a task without journeys run together in a batch (`together`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from albot_agents.benchmark.cell import Cell, EpisodeResult
from albot_agents.benchmark.entrant import Entrant, find_entrant
from albot_agents.benchmark.folder import CellResults, ResultsFolder, cell_name
from albot_agents.benchmark.protocol import EpisodeKey
from albot_agents.benchmark.times import Spent, add_times
from albot_agents.engine.engine import Crash, Engine, OnStep
from albot_agents.evaluation.paired import check_same_episodes
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.together import can_run_together, run_together
from albot_agents.evaluation.trial import FailedTrial, run_trial
from albot_core.errors import InputError

_MOST_TOGETHER = 9
"""Largest number of episodes that a process runs before they are kept: those that are lost if it is
killed."""
_BATCH = 20
"""Number of episodes in a batch."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """The cells of an entrant in a task."""

    entrant: Entrant
    """The entrant."""
    task: str
    """Id of the environment."""
    odometers: tuple[str, ...]
    """Presets of odometer noise."""
    worlds: tuple[str, ...]
    """Kinds of worlds."""

    @property
    def cells(self) -> list[Cell]:
        """The cells, kind by kind."""
        return [
            self.entrant.cell(self.task, odometer, kind)
            for kind in self.worlds
            for odometer in self.odometers
        ]


@dataclass(frozen=True, kw_only=True)
class _Member:
    """An episode that is to be run."""

    cell: Cell
    """Its cell."""
    key: EpisodeKey
    """Its world and seed, as the protocol names them."""
    trial: Trial
    """The episode."""


@dataclass(frozen=True, kw_only=True)
class _Group:
    """Episodes that one process runs: of one world and seed, or of one cell in a batch."""

    members: tuple[_Member, ...]
    """The episodes."""
    together: bool = False
    """Whether they run in a batch."""


class BenchmarkRun:
    """The episodes of some rows that a folder lacks.

    Args:
        folder: The folder.
        rows: The rows.
        episodes: Number of episodes of each cell, the first of the protocol's; None for all.
        plans: The folder of the floor plans; None if no row needs it.

    Raises:
        InputError: Worlds are not the protocol's, an environment cannot be made, agents would meet
            different episodes, or the folder holds other results of an agent of that name.
    """

    def __init__(
        self,
        folder: ResultsFolder,
        rows: Sequence[Row],
        episodes: int | None = None,
        plans: Path | None = None,
    ) -> None:
        self._folder, self._rows, self._plans = folder, rows, plans
        self._protocol = folder.protocol
        self._limit = episodes
        self.failed: list[FailedTrial] = []
        """The episodes that crashed, or that the same task was to run; the folder lacks them."""
        self._settings: dict[tuple[str, str, str, str], dict[str, Any]] = {}
        self._fingerprints = {row.entrant.name: row.entrant.fingerprint for row in rows}
        self._sources = {
            (row.entrant.name, row.entrant.mapper): row.entrant.sources for row in rows
        }
        for kind in dict.fromkeys(kind for row in rows for kind in row.worlds):
            self._protocol.check_worlds(kind, plans)
        for task in dict.fromkeys(row.task for row in rows):
            self._check_task([row for row in rows if row.task == task])
        cells = [cell for row in rows for cell in row.cells]
        assert len(set(cells)) == len(cells), "a cell is in two rows"
        self.take_stock(folder.read())

    def take_stock(self, results: Iterable[CellResults], source: object = None) -> None:
        """Note what the folder has, or will have before the run.

        Args:
            results: The results.
            source: Where they are from, for errors; None for the folder.

        Raises:
            InputError: Some are of another agent of a row's name, or of another state of its agent
                or mapper.
        """
        self._done: dict[Cell, set[tuple[str, int]]]
        self._done = {cell: set() for row in self._rows for cell in row.cells}
        for found in results:
            file = source or self._folder.file(found.cell)
            self._check_fingerprint(found, file)
            self._check_sources(found, file)
            if found.cell in self._done:
                self._done[found.cell] = {(one.world, one.seed) for one in found.episodes}

    def _check_fingerprint(self, found: CellResults, file: object) -> None:
        """Raise InputError for results of another agent of a row's name."""
        agent = found.cell.agent
        if found.fingerprint != self._fingerprints.get(agent, found.fingerprint):
            expected = f"results of the same agent {agent}; remove its files to measure anew"
            raise InputError(file, expected, "those of another of that name")

    def _check_sources(self, found: CellResults, file: object) -> None:
        """Raise InputError for results of another state of a row's agent or mapper."""
        cell, agent = found.cell, found.cell.agent
        wanted = self._sources.get((agent, cell.mapper), found.sources)
        if cell in self._done and found.sources != wanted:
            expected = f"results of the installed sources of {agent} and its mapper ({wanted}); "
            expected += "--check, or remove the file to measure anew"
            raise InputError(file, expected, f"those of others ({found.sources})")

    @property
    def is_complete(self) -> bool:
        """Whether the folder has all of the protocol's episodes of the rows."""
        return all(
            len(done) == len(self._protocol.keys(cell.task, cell.worlds))
            for cell, done in self._done.items()
        )

    @property
    def missing(self) -> int:
        """Number of episodes that the folder lacks."""
        return sum(len(group.members) for group in self._groups())

    def run(self, engine: Engine, on_done: Callable[[int], None] = lambda _: None) -> None:
        """Run the missing episodes, and keep each as soon as it is over.

        All cells grow evenly, so that a table of a run that was stopped has figures everywhere.

        Args:
            engine: Runs them.
            on_done: Called with the number of episodes done by this run.

        Raises:
            InputError: The engine cannot be started, another process writes into the folder, or it
                cannot be written, or holds other results of an agent of that name by now.
        """
        engine.start()
        self._folder.begin()
        with self._folder.locked():
            self.take_stock(self._folder.read())  # Another process may have written until now.
            self._keep_agents()
            count = 0
            with closing(engine.run(_run_group, self._groups())) as results:
                for done in results:
                    if isinstance(done.result, Crash):
                        trials = [member.trial for member in done.task.members]
                        self.failed += [
                            FailedTrial(trial=each, crash=done.result) for each in trials
                        ]
                        continue
                    self._keep(done.result)
                    count += len(done.result)
                    on_done(count)

    def _keep(self, measured: Sequence[Measured]) -> None:
        for one in measured:
            cell, episode = one.cell, one.episode
            self._folder.add(
                CellResults(
                    cell=cell,
                    fingerprint=self._fingerprints[cell.agent],
                    sources=self._sources[cell.agent, cell.mapper],
                    episodes=[episode],
                )
            )
            self._done[cell].add((episode.world, episode.seed))
        spent = [(cell_name(one.cell), Spent(episodes=1, seconds=one.seconds)) for one in measured]
        add_times(self._folder.path, spent)

    def _check_task(self, rows: Sequence[Row]) -> None:
        """Check the settings of a task's rows, and that they are of the protocol's episodes.

        These are the episodes of the task's reference, be it among the rows or not.
        """
        task = rows[0].task
        reference = find_entrant(self._protocol.tasks[task].reference)
        first = replace(rows[0], entrant=reference)
        key = self._protocol.keys(task, first.worlds[0])[0]
        trials = {reference.name: self._trial(first, first.cells[0], key)}
        for row in rows:
            cell = row.entrant.cell(task, row.odometers[0], first.worlds[0])
            trial = self._trial(row, cell, key)
            trial.make().close()
            is_own = cell.mapper == row.entrant.entry.mapper
            trials[cell.agent if is_own else f"{cell.agent} with {cell.mapper}"] = trial
        check_same_episodes(trials)

    def _keep_agents(self) -> None:
        for entrant in {row.entrant.name: row.entrant for row in self._rows}.values():
            if entrant.entry.file is not None:
                self._folder.write_agent(entrant)

    def _keys(self, cell: Cell) -> list[EpisodeKey]:
        return self._protocol.keys(cell.task, cell.worlds)[: self._limit]

    def _groups(self) -> Iterator[_Group]:
        """Yield what is missing: the first episode of every cell, then the second, and so on."""
        kinds: dict[tuple[str, str], list[tuple[Row, Cell]]] = {}
        for row in self._rows:
            for cell in row.cells:
                kinds.setdefault((row.task, cell.worlds), []).append((row, cell))
        order = self._protocol.odometers.index
        for members in kinds.values():  # Who makes the same journey comes together.
            members.sort(key=lambda member: (member[1].mapper, order(member[1].odometer)))
        keys = {kind: self._keys(members[0][1]) for kind, members in kinds.items()}
        for number in range(max(map(len, keys.values()), default=0)):
            for kind, members in kinds.items():
                batched = [member for member in members if _in_batches(member[0])]
                alone = [member for member in members if not _in_batches(member[0])]
                if number % _BATCH == 0:
                    some = keys[kind][number : number + _BATCH]
                    yield from self._groups_of(([member], some, True) for member in batched)
                for key in keys[kind][number : number + 1]:
                    yield from self._groups_of([(alone, [key], False)])

    def _groups_of(
        self, parts: Iterable[tuple[Sequence[tuple[Row, Cell]], Sequence[EpisodeKey], bool]]
    ) -> Iterator[_Group]:
        """Yield groups of what is missing of cells' episodes, and whether they are batches."""
        for cells, keys, together in parts:
            missing = (
                _Member(cell=cell, key=key, trial=self._trial(row, cell, key))
                for row, cell in cells
                for key in keys
                if (key.world, key.seed) not in self._done[cell]
            )
            while some := tuple(islice(missing, _BATCH if together else _MOST_TOGETHER)):
                yield _Group(members=some, together=together)

    def _trial(self, row: Row, cell: Cell, key: EpisodeKey) -> Trial:
        """Return an episode of a cell."""
        same = (cell.agent, cell.mapper, cell.task, cell.odometer)
        if same not in self._settings:
            self._settings[same] = row.entrant.environment(self._protocol, row.task, cell.odometer)
        world = key.world
        if self._protocol.worlds[cell.worlds].files is not None:
            assert self._plans is not None, "check_worlds has refused it"
            world = str(self._plans / key.world)
        return Trial(
            task=row.task,
            agent=row.entrant.source,
            world=world,
            seed=key.seed,
            settings=self._settings[same],
        )


def _in_batches(row: Row) -> bool:
    """Return whether a row's episodes run in batches.

    Those of scripted agents do not: what costs most is what they do, which a batch does not share.
    """
    return row.entrant.entry.file is not None and can_run_together(row.task)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """An episode that was run."""

    cell: Cell
    """Its cell."""
    episode: EpisodeResult
    """Its result."""
    seconds: float
    """Processor time that it took, or its share of that of its batch (s)."""


def _run_group(group: _Group, on_step: OnStep, /) -> list[Measured]:
    """Run the episodes of a group, in a batch or one after another."""
    trials = [member.trial for member in group.members]
    outcomes, seconds = [], []
    for some in [trials] if group.together else [[trial] for trial in trials]:
        before = time.process_time()
        outcomes += run_together(some, on_step) if group.together else [run_trial(some[0], on_step)]
        seconds += [(time.process_time() - before) / len(some)] * len(some)
    return [
        Measured(
            cell=member.cell,
            episode=EpisodeResult.of(outcome, member.cell.agent, member.key.world),
            seconds=spent,
        )
        for member, outcome, spent in zip(group.members, outcomes, seconds, strict=True)
    ]
