"""Make journeys in parallel processes before the first reset.

A journey is the outward drive after which an episode begins. Otherwise the training process makes
each journey when a reset first draws it, which takes minutes for a few hundred. The worker
processes import only this module, which does not load PyTorch.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium

import albot_env  # noqa: F401  (registers the environments)
from albot_agents.engine.engine import OnStep
from albot_agents.engine.local import LocalEngine
from albot_core.errors import InputError

FEWEST_JOURNEYS = 16
"""Smallest number of journeys for which starting processes is worthwhile."""
_BATCH_ONLY = ("autoreset_mode", "max_episode_steps", "threads", "world")
"""Settings of a batch that journeys do not depend on."""


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
    # The first one is made here: numba caches the compiled code, so no process compiles again.
    if (first := _make_journey(batch.journeys, tickets[0])) is not None:
        batch.journeys.keep(tickets[0], first)
        if not batch.missing_journeys():  # The first one's size shows that not all can be kept.
            report(f"1 of {len(tickets)} journeys made; the others are made when needed")
            return
    report(f"1 of {len(tickets)} journeys made")
    others = LocalEngine(jobs).run(_JourneyMaker(task, single), tickets[1:])
    for count, done in enumerate(others, start=2):
        journey = done.required(f"{task}, journey {done.number + 1} in {done.task.world.name}")
        if journey is not None:
            batch.journeys.keep(done.task, journey)
        report(f"{count} of {len(tickets)} journeys made")


class _JourneyMaker:
    """Makes journeys in the worker process's own environment, from the environment's tickets."""

    def __init__(self, task: str, settings: Mapping[str, Any]) -> None:
        self._task, self._settings = task, settings
        self._journeys: Any = None

    def __call__(self, ticket: Any, on_step: OnStep, /) -> Any:
        """Make a journey; return None if it cannot be made."""
        if self._journeys is None:
            env = gymnasium.make(self._task, world=ticket.world, **self._settings)
            self._journeys = env.get_wrapper_attr("journeys")
        return _make_journey(self._journeys, ticket)


def _make_journey(journeys: Any, ticket: Any) -> Any:
    try:
        return journeys.travel(ticket)
    except InputError:
        return None
