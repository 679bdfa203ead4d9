"""Make journeys in parallel processes before the first reset.

A journey is the outward drive after which an episode begins. Otherwise the training process makes
each journey when a reset first draws it, which takes minutes for a few hundred. The worker
processes import only this module, which does not load PyTorch.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from itertools import chain
from typing import Any

import gymnasium

import albot_env  # noqa: F401  (registers the environments)
from albot_agents.workers import TaskRunner, run_parallel
from albot_core.errors import InputError

FEWEST_JOURNEYS = 16
"""Smallest number of journeys for which starting processes is worthwhile."""
_BATCH_ONLY = ("autoreset_mode", "max_episode_steps", "threads", "world")
"""Settings of a batch that journeys do not depend on."""

NumberedTicket = tuple[int, Any]
"""The number of a journey, and the environment's ticket from which it is made."""


def prepare_journeys(
    task: str,
    batch: Any,
    settings: Mapping[str, Any],
    report: Callable[[str], None] = lambda note: None,
) -> None:
    """Make the journeys that a batch's resets may draw, if there are many and all can be kept.

    A journey that cannot be made is left out; the reset that draws it raises the error.

    Args:
        task: Id of the environment.
        batch: The batch.
        settings: The batch's settings. With `threads` 1 no processes are started.
        report: Called with the progress as text.
    """
    tickets = batch.missing_journeys()
    jobs = settings.get("threads") or os.cpu_count() or 1
    if len(tickets) < FEWEST_JOURNEYS or jobs == 1:
        return
    single = {name: value for name, value in settings.items() if name not in _BATCH_ONLY}
    report(f"0 of {len(tickets)} journeys made")
    numbered = list(enumerate(tickets))
    # The first one is made here: numba caches the compiled code, so no process compiles again.
    first = _make_journey(batch.journeys, numbered[0])
    if first[1] is not None:
        batch.journeys.keep(tickets[0], first[1])
        if not batch.missing_journeys():  # The first one's size shows that not all can be kept.
            report(f"1 of {len(tickets)} journeys made; the others are made when needed")
            return
    others = run_parallel(_JourneyRunner(task, single), numbered[1:], min(jobs, len(tickets) - 1))
    for done, (number, journey) in enumerate(chain([first], others), start=1):
        if journey is not None:
            batch.journeys.keep(tickets[number], journey)
        report(f"{done} of {len(tickets)} journeys made")


class _JourneyRunner(TaskRunner[NumberedTicket, "tuple[int, Any]"]):
    """Makes journeys in the worker process's own environment."""

    def __init__(self, task: str, settings: Mapping[str, Any]) -> None:
        self._task, self._settings = task, settings
        self._journeys: Any = None

    def run(self, task: NumberedTicket, on_step: Callable[[int], None]) -> tuple[int, Any]:
        """Make a journey."""
        if self._journeys is None:
            env = gymnasium.make(self._task, world=task[1].world, **self._settings)
            self._journeys = env.get_wrapper_attr("journeys")
        return _make_journey(self._journeys, task)

    def on_crash(self, task: NumberedTicket, step: int, cause: str) -> tuple[int, Any]:
        """Raise RuntimeError: the process died, which is a bug.

        Raises:
            RuntimeError: Always.
        """
        number, ticket = task
        raise RuntimeError(f"{self._task}, journey {number} in {ticket.world.name}: {cause}")


def _make_journey(journeys: Any, numbered: NumberedTicket) -> tuple[int, Any]:
    """Return a journey's number, and the journey; None if it cannot be made."""
    number, ticket = numbered
    try:
        return number, journeys.travel(ticket)
    except InputError:
        return number, None
