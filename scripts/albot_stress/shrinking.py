"""Shrink a violation: a simpler episode in which the same invariant is violated.

As hypothesis shrinks what falsifies a test (MacIver and Donaldson, Test-case reduction via
test-case generation, ECOOP 2020), simpler episodes are tried, and whichever violates the same
invariant takes the place of the one before, until none does or time is up.
"""

from __future__ import annotations

import dataclasses
import re
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from albot_agents.registry import find_agent
from albot_core.errors import InputError
from albot_core.mappers.registry import NO_MAPPER
from albot_env.stress.checks import ERROR
from albot_maps.generators.parameters import ParameterRange
from albot_maps.generators.spec import PREFIX, parse_spec
from albot_stress.episodes import Episode, Violation
from albot_stress.running import Checks, OnStep, record_episode, run_episode

SEEDS = 8
"""Number of the smallest seeds that are tried in place of a larger one."""
_MOVABLES = ("people", "boxes", "doors")
_SIZES = (
    "rooms", "loops", "width", "depth", "length", "growth", "columns", "rows", "aisles", "bays",
    "cross_aisles", "porches", "pillars", "connections", "clutter", "starts", "symmetry",
)  # fmt: skip
"""Parameters of random worlds that make them larger, or less simple."""


@dataclass(frozen=True, kw_only=True)
class ShrinkTask:
    """A violation to shrink."""

    violation: Violation
    """The violation."""
    checks: Checks
    """What is checked."""
    seconds: float
    """Time after which no simpler episode is tried (s)."""
    record: Path | None = None
    """File for the simplest episode; None for none."""


@dataclass(frozen=True, kw_only=True)
class Shrunk:
    """A violation and the simplest one that was found in its place."""

    original: Violation
    """The violation as it was found."""
    violation: Violation
    """The simplest one of the same invariant."""
    tried: int
    """Number of episodes that were tried."""


def shrink(task: ShrinkTask, on_step: OnStep = lambda _: None) -> Shrunk:
    """Return the simplest violation of the same invariant that is found in time.

    Args:
        task: What to shrink.
        on_step: Called with the number of each step of each episode that is tried.
    """
    found = _Shrinker(task, on_step).run()
    if task.record is not None:
        with suppress(Exception):  # What is violated may end it; the file holds all before.
            record_episode(found.violation.episode, task.record)
    return found


class _Shrinker:
    """Tries simpler episodes.

    Args:
        task: What to shrink.
        on_step: Called with the number of each step.
    """

    def __init__(self, task: ShrinkTask, on_step: OnStep) -> None:
        self._task = task
        self._on_step = on_step
        self._best = task.violation
        self._until = time.monotonic() + task.seconds
        self._seen: list[Episode] = [task.violation.episode]

    def run(self) -> Shrunk:
        """Try what is simpler than the best until nothing is accepted, or time is up."""
        going = True
        while going and not self._is_late():
            going = any(self._accept(each) for each in simpler(self._best.episode))
        violation, step = self._best, max(1, self._best.step)
        episode = replace(violation.episode, steps=step)
        if episode != violation.episode and self._violation_of(episode) is not None:
            violation = replace(violation, episode=episode)
        return Shrunk(original=self._task.violation, violation=violation, tried=len(self._seen) - 1)

    def _is_late(self) -> bool:
        return time.monotonic() > self._until

    def _accept(self, episode: Episode) -> bool:
        """Return whether an episode violates the same invariant; it is then the best one."""
        if self._is_late() or episode in self._seen:
            return False
        found = self._violation_of(episode)
        if found is not None:
            self._best = found
        return found is not None

    def _violation_of(self, episode: Episode) -> Violation | None:
        """Run an episode; return its first violation of the same invariant."""
        self._seen.append(episode)
        outcome = run_episode(episode, self._on_step, self._task.checks)
        wanted = _signature(self._task.violation)
        return next((each for each in outcome.violations if _signature(each) == wanted), None)


def _signature(violation: Violation) -> tuple[str, ...]:
    """Return what two violations have in common if they are the same.

    Of errors, these are the type and the line that raised it.
    """
    if violation.invariant != ERROR:
        return (violation.invariant,)
    kind, _, rest = violation.what.partition(":")
    return violation.invariant, kind, *re.findall(r"\([^()]+:\d+\)$", rest)


def simpler(episode: Episode) -> Iterator[Episode]:
    """Yield episodes that are simpler in one thing, the largest steps first."""
    if episode.movables:
        yield replace(episode, movables=False)
    if episode.faults is not None:
        faults = episode.faults.split("+")
        yield replace(episode, faults=None)
        if len(faults) > 1:
            for k in range(len(faults)):
                yield replace(episode, faults="+".join(faults[:k] + faults[k + 1 :]))
    if episode.mapper != NO_MAPPER and find_agent(episode.agent).file is None:
        without: dict[str, Any] = {"mapper_config": None, "mapper_config_file": None}
        yield replace(episode, mapper=NO_MAPPER, **without)
        if episode.mapper_config is not None:
            yield replace(episode, **without)
    if episode.odometer != "ideal":
        yield replace(episode, odometer="ideal")
    if episode.world.startswith(PREFIX):
        yield from _simpler_worlds(episode)
    for seed in range(min(episode.seed, SEEDS)):
        yield replace(episode, seed=seed)


def _simpler_worlds(episode: Episode) -> Iterator[Episode]:
    """Yield the episode in smaller random worlds, with fewer things that move."""
    try:
        spec = parse_spec(episode.world)
    except InputError:
        return
    ranges = spec.parameters.ranges()
    for name in (*_MOVABLES, *_SIZES):
        if name not in ranges:
            continue
        for value in _smaller(ranges[name], getattr(spec.parameters, name)):
            changed = dataclasses.replace(spec.parameters, **{name: value})
            yield replace(episode, world=str(dataclasses.replace(spec, parameters=changed)))
    for seed in range(min(spec.seed, SEEDS)):
        yield replace(episode, world=str(dataclasses.replace(spec, seed=seed)))


def _smaller(allowed: ParameterRange, value: Any) -> Iterator[Any]:
    """Yield smaller values of a parameter: the smallest first, then halfway to it."""
    if allowed.type is bool:
        if value:
            yield False
        return
    least = 0 if allowed.zero else allowed.minimum
    if value is None or value > least:
        yield allowed.type(least)
    if value is not None and value - least > 1:
        yield allowed.type(least + (value - least) / 2)
