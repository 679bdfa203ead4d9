"""The episodes of `albot evaluate`, run in parallel, and the data set that is made of them."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, Any

from albot_agents.engine.engine import Crash, Engine
from albot_agents.evaluation.outcome_rows import outcome_of, row_of
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.together import run_together
from albot_agents.evaluation.trial import FailedTrial, Outcome, run_recorded, run_trial
from albot_cli.evaluation_recordings import remove_recordings
from albot_cli.progress import progress
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_agents.engine.rows import RowsFolder
    from albot_agents.evaluation.recordings import Recordings
    from albot_env.export.minari_dataset import DatasetPlace, MinariWriter
    from albot_env.export.transitions import Transitions


@dataclass(frozen=True, kw_only=True)
class Evaluated:
    """The episodes of an evaluation that have ended."""

    outcomes: list[list[Outcome]]
    """The outcomes of each agent, in the order of the trials, for the trials that have ended with
    all agents."""
    failed: list[FailedTrial]
    """The trials that crashed, in the order in which they were run."""
    stopped: bool
    """Whether Ctrl-C stopped the run."""


def run_trials(
    trials: list[list[Trial]],
    engine: Engine,
    batch: int,
    dataset: OrderedDataset,
    recordings: Recordings | None = None,
    rows: RowsFolder | None = None,
    *,
    resumes: bool = False,
) -> Evaluated:
    """Run the trials of all agents in turn, so that a stopped run has the same episodes of each.

    Args:
        trials: The trials of each agent, all in the same order.
        engine: Runs them.
        batch: Number of episodes that a process steps together.
        dataset: Takes the transitions.
        recordings: Where the episodes are recorded; of those that have not ended with all agents,
            nothing is left there.
        rows: Takes a row of each episode; None for none.
        resumes: Whether `rows` has some already, whose trials are not run again.

    Raises:
        InputError: A trial cannot be run, or as `RowsFolder.opened`.
    """
    engine.start()
    opened: AbstractContextManager[Mapping[int, Any]]
    opened = nullcontext({}) if rows is None else rows.opened(resume=resumes)
    with opened as known:
        done = {}
        for number, row in known.items():
            k, agent = divmod(number, len(trials))
            trial = trials[agent][k]
            assert rows is not None
            done[trial.agent, k] = outcome_of(row, trial, rows.path)
        return _run_others(trials, done, engine, batch, dataset, recordings, rows)


def _run_others(
    trials: list[list[Trial]],
    done: dict[tuple[str, int], Outcome],
    engine: Engine,
    batch: int,
    dataset: OrderedDataset,
    recordings: Recordings | None,
    rows: RowsFolder | None,
) -> Evaluated:
    """Run the trials that are not done, by agent and number; see `run_trials`."""
    failed: dict[tuple[int, int], FailedTrial] = {}
    stopped = False
    numbers = {(trial.world, trial.seed): k for k, trial in enumerate(trials[0])}
    agents = [some[0].agent for some in trials]
    every = [trial for some in trials for trial in some]
    left = [[(agent, k) not in done for k in range(len(trials[0]))] for agent in agents]
    results = _results(trials, left, engine, batch, recordings)
    board = progress("evaluate", len(every), "episodes", start=len(done))
    try:
        with board as update, closing(results):
            for result in results:
                trial = result.trial
                number = numbers[trial.world, trial.seed]
                if isinstance(result, FailedTrial):
                    failed[number, agents.index(trial.agent)] = result
                else:
                    if rows is not None:
                        place = number * len(agents) + agents.index(trial.agent)
                        rows.add(place, row_of(result))
                    done[trial.agent, number] = dataset.add(number, result)
                update(len(done) + len(failed), f"{len(failed)} failed" if failed else "")
    except KeyboardInterrupt:
        stopped = True
    except (InputError, OSError):
        remove_recordings(recordings, every)
        raise
    dataset.finish()
    ended = [k for k in range(len(trials[0])) if all((agent, k) in done for agent in agents)]
    unfinished = [some[k] for some in trials for k in range(len(some)) if k not in ended]
    remove_recordings(recordings, unfinished)
    return Evaluated(
        outcomes=[[done[agent, k] for k in ended] for agent in agents],
        failed=[failed[place] for place in sorted(failed)],
        stopped=stopped,
    )


def _results(
    trials: list[list[Trial]],
    left: list[list[bool]],
    engine: Engine,
    batch: int,
    recordings: Recordings | None,
) -> Generator[Outcome | FailedTrial, None, None]:
    """Yield the outcomes of those trials of all agents that are `left`, as they end.

    Raises:
        InputError: A trial cannot be run.
    """
    if batch == 1:
        run = run_trial if recordings is None else partial(run_recorded, recordings=recordings)
        masks = list(zip(trials, left, strict=True))
        each = [some[k] for k in range(len(trials[0])) for some, mask in masks if mask[k]]
        with closing(engine.run(run, each)) as singles:
            for one in singles:
                if isinstance(one.result, Crash):
                    yield FailedTrial(trial=one.task, crash=one.result)
                else:
                    yield one.result
        return
    starts = range(0, len(trials[0]), batch)
    parts = [
        list(compress(some[start : start + batch], mask[start : start + batch]))
        for start in starts
        for some, mask in zip(trials, left, strict=True)
    ]
    with closing(engine.run(run_together, [part for part in parts if part])) as batches:
        for done in batches:
            if isinstance(done.result, Crash):
                yield from (FailedTrial(trial=trial, crash=done.result) for trial in done.task)
            else:
                yield from done.result


@contextmanager
def open_dataset(place: DatasetPlace | None, *, force: bool) -> Iterator[OrderedDataset]:
    """Yield what writes episodes as a data set, which appears when the block ends.

    Args:
        place: Where it is to be; None for no data set.
        force: Whether a data set that is there is replaced.

    Raises:
        InputError: As `new_minari_dataset`.
    """
    if place is None:
        yield OrderedDataset(None)
        return
    from albot_env.export.minari_dataset import new_minari_dataset

    with new_minari_dataset(place, force=force) as writer:
        yield OrderedDataset(writer)


class OrderedDataset:
    """Writes the transitions of outcomes, which come in any order, in the order of the trials.

    Args:
        writer: Writes a data set; None for no data set.
    """

    def __init__(self, writer: MinariWriter | None) -> None:
        self._writer = writer
        self._waiting: dict[int, Transitions] = {}
        self._next = 0

    @property
    def size(self) -> dict[str, int]:
        """Its numbers of episodes and of steps."""
        assert self._writer is not None
        return {"episodes": self._writer.episodes, "steps": self._writer.steps}

    def add(self, number: int, outcome: Outcome) -> Outcome:
        """Write an outcome's transitions when it is their turn; return it without them."""
        if self._writer is None or outcome.transitions is None:
            return outcome
        self._waiting[number] = outcome.transitions
        while self._next in self._waiting:
            self._write(self._next)
            self._next += 1
        return replace(outcome, transitions=None)

    def finish(self) -> None:
        """Write those that wait for others, which a stopped run does not have."""
        for number in sorted(self._waiting):
            self._write(number)

    def _write(self, number: int) -> None:
        assert self._writer is not None
        self._writer.add(self._waiting.pop(number), f"episode {number}")
