"""Journeys laid in before a training begins, made in parallel processes.

Else each is made, in the one process of the training, when a reset first draws it, which for some
hundred takes minutes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from itertools import chain
from typing import Any

import gymnasium

import albot_env  # noqa: F401  (registers the environments)
from albot_agents.workers import Trade, run_parallel
from albot_core.errors import InputError

FEWEST = 16
"""Journeys for which it is not worth it to start processes."""
_BATCH_ONLY = ("autoreset_mode", "max_episode_steps", "threads", "world")
"""Settings of a batch that journeys do not depend on."""

Errand = tuple[int, Any]
"""The number of a journey, and its ticket."""


def lay_in(
    task: str,
    batch: Any,
    settings: Mapping[str, Any],
    tell: Callable[[str], None] = lambda note: None,
) -> None:
    """Make the journeys that a batch's resets may draw, if there are many and all can be kept.

    What cannot be made is left out: the reset that draws it says what is wrong.

    Args:
        task: Id of the environment.
        batch: The batch.
        settings: What it was made with. With `threads` 1 everything stays in this process.
        tell: Is told how it goes.
    """
    tickets = batch.missing_journeys()
    jobs = settings.get("threads") or os.cpu_count() or 1
    if len(tickets) < FEWEST or jobs == 1:
        return
    scout = {name: value for name, value in settings.items() if name not in _BATCH_ONLY}
    tell(f"0 of {len(tickets)} journeys made")
    errands = list(enumerate(tickets))
    # The first one here: numba then keeps what it compiles, and no process has to do it again.
    first = _make(batch.journeys, errands[0])
    others = run_parallel(_Making(task, scout), errands[1:], min(jobs, len(tickets) - 1))
    for done, (number, journey) in enumerate(chain([first], others), start=1):
        if journey is not None:
            batch.journeys.keep(tickets[number], journey)
        tell(f"{done} of {len(tickets)} journeys made")


class _Making(Trade[Errand, "tuple[int, Any]"]):
    """Makes journeys, in an environment of its own."""

    def __init__(self, task: str, settings: Mapping[str, Any]) -> None:
        self._task, self._settings = task, settings
        self._journeys: Any = None

    def work(self, task: Errand, tell: Callable[[int], None]) -> tuple[int, Any]:
        """Make a journey."""
        if self._journeys is None:
            env = gymnasium.make(self._task, world=task[1].world, **self._settings)
            self._journeys = env.get_wrapper_attr("journeys")
        return _make(self._journeys, task)

    def died(self, task: Errand, step: int, cause: str) -> tuple[int, Any]:
        """A journey that was not survived: our fault.

        Raises:
            RuntimeError: Always.
        """
        number, ticket = task
        raise RuntimeError(f"{self._task}, journey {number} in {ticket.world.name}: {cause}")


def _make(journeys: Any, errand: Errand) -> tuple[int, Any]:
    """The number of a journey, and the journey; None where it cannot be made."""
    number, ticket = errand
    try:
        return number, journeys.travel(ticket)
    except InputError:
        return number, None
