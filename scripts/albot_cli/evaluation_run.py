"""The episodes of `albot evaluate`, run in parallel, and the data set that is made of them."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.together import BatchRunner
from albot_agents.evaluation.trial import Outcome, TrialRunner
from albot_cli.evaluation_recordings import remove_recordings
from albot_cli.progress import progress
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_agents.evaluation.recordings import Recordings
    from albot_env.export.minari_dataset import DatasetPlace, MinariWriter
    from albot_env.export.transitions import Transitions


def run_trials(
    trials: list[list[Trial]],
    jobs: int,
    batch: int,
    dataset: OrderedDataset,
    recordings: Recordings | None = None,
) -> tuple[list[list[Outcome]], bool]:
    """Run the trials of all agents in turn, so that a stopped run has the same episodes of each.

    Args:
        trials: The trials of each agent, all in the same order.
        jobs: Number of processes.
        batch: Number of episodes that a process steps together.
        dataset: Takes the transitions.
        recordings: Where the episodes are recorded; of those that have not ended with all agents,
            nothing is left there.

    Returns:
        The outcomes of each agent, in the order of the trials, for the trials that have ended with
        all agents; and whether Ctrl-C stopped the run.

    Raises:
        InputError: A trial cannot be run.
    """
    done: dict[tuple[str, int], Outcome] = {}
    stopped = False
    numbers = {(trial.world, trial.seed): k for k, trial in enumerate(trials[0])}
    count = sum(map(len, trials))
    every = [trial for some in trials for trial in some]
    results = _results(trials, min(jobs, count), batch, recordings)
    try:
        with progress("evaluate", count, "episodes") as update, closing(results):
            for outcome in results:
                trial = outcome.trial
                number = numbers[trial.world, trial.seed]
                done[trial.agent, number] = dataset.add(number, outcome)
                update(len(done))
    except KeyboardInterrupt:
        stopped = True
    except (InputError, RuntimeError):
        remove_recordings(recordings, every)
        raise
    dataset.finish()
    agents = [some[0].agent for some in trials]
    ended = [k for k in range(len(trials[0])) if all((agent, k) in done for agent in agents)]
    unfinished = [some[k] for some in trials for k in range(len(some)) if k not in ended]
    remove_recordings(recordings, unfinished)
    return [[done[agent, k] for k in ended] for agent in agents], stopped


def _results(
    trials: list[list[Trial]], jobs: int, batch: int, recordings: Recordings | None
) -> Generator[Outcome, None, None]:
    """Yield the outcomes of the trials of all agents as they end.

    Raises:
        InputError: A trial cannot be run.
    """
    from albot_agents.workers import run_parallel

    results: Generator[Any, None, None]
    if batch == 1:
        each = [trial for paired in zip(*trials, strict=True) for trial in paired]
        results = run_parallel(TrialRunner(recordings), each, jobs)
    else:
        starts = range(0, len(trials[0]), batch)
        groups = [some[start : start + batch] for start in starts for some in trials]
        results = run_parallel(BatchRunner(), groups, min(jobs, len(groups)))
    with closing(results):
        for found in results:
            if isinstance(found, InputError):
                raise found
            yield from found if isinstance(found, list) else [found]


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
