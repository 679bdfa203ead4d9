"""Running the episodes of the table of results, those of one world and seed in one process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from typing import Any

from albot_agents.evaluation.summary import summarise
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_agents.results.contest import Cell, Meeting
from albot_agents.workers import Trade, run_parallel
from albot_core.errors import InputError

Figures = Mapping[Cell, Mapping[str, Any]]
"""What came of each row: see `summarise`."""


class Meetings(Trade[tuple[int, Meeting], "tuple[int, list[Outcome]] | InputError"]):
    """Runs meetings; journeys that agents share are made once, as one process makes them."""

    def work(
        self, task: tuple[int, Meeting], tell: Callable[[int], None]
    ) -> tuple[int, list[Outcome]] | InputError:
        """Run all episodes of a meeting."""
        number, meeting = task
        try:
            return number, [run_trial(trial, tell) for trial in meeting.trials]
        except InputError as error:
            return error

    def died(
        self, task: tuple[int, Meeting], step: int, cause: str
    ) -> tuple[int, list[Outcome]] | InputError:
        """A meeting that was not survived: our fault.

        Raises:
            RuntimeError: Always.
        """
        trial = task[1].trials[0]
        raise RuntimeError(f"{trial.task} in {trial.world}, seed {trial.seed}: {cause}")


def run_meetings(
    meetings: Sequence[Meeting], jobs: int, tell: Callable[[int], None] = lambda _: None
) -> Figures:
    """The figures of each row.

    Args:
        meetings: The episodes.
        jobs: Processes.
        tell: Is called with how many meetings are over.

    Raises:
        InputError: There is no such world, mapper or sensor.
    """
    done: dict[int, list[Outcome]] = {}
    results = run_parallel(Meetings(), enumerate(meetings), min(jobs, len(meetings)))
    with closing(results):
        for result in results:
            if isinstance(result, InputError):
                raise result
            number, outcomes = result
            done[number] = outcomes
            tell(len(done))
    rows: dict[Cell, list[Outcome]] = {}
    for number, meeting in enumerate(meetings):
        for cell, outcome in zip(meeting.cells, done[number], strict=True):
            rows.setdefault(cell, []).append(outcome)
    return {cell: summarise(outcomes) for cell, outcomes in rows.items()}
