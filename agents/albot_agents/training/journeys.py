"""Make journeys in parallel processes before the first reset.

A journey is the outward drive after which an episode begins. Otherwise the training process makes
each journey when a reset first draws it, which takes minutes for a few hundred. The worker
processes import only this module, which does not load PyTorch.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium

import albot_env  # noqa: F401  (registers the environments)
from albot_agents.engine.engine import OnStep
from albot_agents.engine.local import LocalEngine
from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_env.tasks.core.journeys import Journeys, JourneySpec
from albot_maps import World

FEWEST_JOURNEYS = 16
"""Smallest number of journeys for which starting processes is worthwhile."""
_BATCH_ONLY = ("autoreset_mode", "max_episode_steps", "threads", "world")
"""Settings of a batch that journeys do not depend on."""


class MadeJourneys:
    """Journeys that one process has made, for another one whose environments make the same.

    Unlike the keys of a process's cache, these hold in all processes: they name a world by all that
    is in it.
    """

    def __init__(self) -> None:
        self._made: dict[tuple[Any, ...], Any] = {}
        self._digests: dict[int, tuple[World, str]] = {}

    def __len__(self) -> int:
        """Return their number."""
        return len(self._made)

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process gets: there, the worlds are other objects."""
        return {"_made": self._made, "_digests": {}}

    def clear(self) -> None:
        """Drop all."""
        self._made.clear()
        self._digests.clear()

    def add(self, journeys: Journeys[Any], spec: JourneySpec, journey: Any) -> None:
        """Add a journey of a kind."""
        self._made[self._key(journeys, spec)] = journey

    def find(self, journeys: Journeys[Any], spec: JourneySpec) -> Any:
        """Return a journey of a kind; None if it is not among these."""
        return self._made.get(self._key(journeys, spec)) if self._made else None

    def _key(self, journeys: Journeys[Any], spec: JourneySpec) -> tuple[Any, ...]:
        world = spec.world
        if id(world) not in self._digests:
            text = json.dumps(to_plain(world), sort_keys=True)
            self._digests[id(world)] = world, hashlib.sha256(text.encode()).hexdigest()
        return journeys.kind, self._digests[id(world)][1], spec.start.tobytes(), spec.number


def prepare_journeys(
    task: str,
    batch: Any,
    settings: Mapping[str, Any],
    report: Callable[[str], None] = lambda note: None,
    made: MadeJourneys | None = None,
) -> None:
    """Make the journeys that a batch's resets may draw, if there are many and all can be kept.

    A journey that cannot be made is left out; the reset that draws it raises the error.

    Args:
        task: Id of the environment.
        batch: The batch.
        settings: The batch's settings. With `threads` 1 no processes are started.
        report: Called with the progress as text.
        made: Journeys that need not be made, to which those that are made here are added.
    """
    made = MadeJourneys() if made is None else made
    tickets = []
    for ticket in batch.missing_journeys():
        if (journey := made.find(batch.journeys, ticket)) is None:
            tickets.append(ticket)
        else:
            batch.journeys.keep(ticket, journey)
    jobs = settings.get("threads") or os.cpu_count() or 1
    if len(tickets) < FEWEST_JOURNEYS or jobs == 1:
        return
    single = {name: value for name, value in settings.items() if name not in _BATCH_ONLY}
    report(f"0 of {len(tickets)} journeys made")
    # The first one is made here: numba caches the compiled code, so no process compiles again.
    if (first := _make_journey(batch.journeys, tickets[0])) is not None:
        _keep(batch.journeys, tickets[0], first, made)
        if not batch.missing_journeys():  # The first one's size shows that not all can be kept.
            report(f"1 of {len(tickets)} journeys made; the others are made when needed")
            return
    report(f"1 of {len(tickets)} journeys made")
    others = LocalEngine(jobs).run(_JourneyMaker(task, single), tickets[1:])
    for count, done in enumerate(others, start=2):
        journey = done.required(f"{task}, journey {done.number + 1} in {done.task.world.name}")
        if journey is not None:
            _keep(batch.journeys, done.task, journey, made)
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


def _keep(journeys: Journeys[Any], ticket: JourneySpec, journey: Any, made: MadeJourneys) -> None:
    made.add(journeys, ticket, journeys.keep(ticket, journey))


def _make_journey(journeys: Any, ticket: Any) -> Any:
    try:
        return journeys.travel(ticket)
    except InputError:
        return None
