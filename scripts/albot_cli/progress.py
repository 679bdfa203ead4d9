"""Report the progress of long work: a bar on a terminal, otherwise occasional lines."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from math import inf
from typing import Any, Protocol, runtime_checkable

import click

EVERY = 60.0
"""Time between two lines without a terminal (s)."""


@runtime_checkable
class ProgressCallback(Protocol):
    """Receives the progress."""

    def __call__(self, done: int, note: str = "", share: float | None = None) -> None:
        """Report that `done` steps are done.

        Args:
            done: Number of steps done so far.
            note: Describes the state.
            share: Share of the work that is done, by which the remaining time is estimated; by
                default that of the steps.
        """


@runtime_checkable
class _Begin(Protocol):
    """Begins a work."""

    def __call__(self, description: str, total: int, start: int = 0) -> ProgressCallback:
        """Return what receives its progress."""


def can_redraw(stream: Any) -> bool:
    """Return whether a stream is a terminal in which lines can be drawn again.

    A stream closed by the caller is None.
    """
    dumb = os.environ.get("TERM", "").lower() in ("dumb", "unknown")
    return stream is not None and stream.isatty() and not dumb


def is_json() -> bool:
    """Return whether the command that runs was called with `--json`."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.params.get("as_json"))


@contextmanager
def progress(
    description: str,
    total: int,
    unit: str = "",
    *,
    start: int = 0,
    every: float | None = None,
) -> Iterator[ProgressCallback]:
    """Show the progress of long work, its rate, and the remaining time.

    It goes to stderr: as a bar if that is a terminal, otherwise as lines. With `--json` it is not
    shown.

    Args:
        description: Name of the work.
        total: Total number of steps.
        unit: Name of a step, in the plural.
        start: Number of steps done before.
        every: Time between two lines (s); by default `EVERY`.

    Yields:
        A callable that takes the number of steps done so far.
    """
    with progress_board(unit, every=every) as begin:
        yield begin(description, total, start)


@contextmanager
def progress_board(unit: str = "", *, every: float | None = None) -> Iterator[_Begin]:
    """Show the progress of several works at a time, each as by `progress`.

    Args:
        unit: Name of a step, in the plural.
        every: Time between two lines of a work (s); by default `EVERY`.

    Yields:
        A callable that begins a work: it takes the arguments `description`, `total` and `start` of
        `progress`, and returns a callable that takes the number of steps done so far.
    """
    if is_json() or not can_redraw(sys.stderr):
        every = inf if is_json() else EVERY if every is None else every
        yield lambda description, total, start=0: _Lines(
            description, _Clock(total, unit, start), every
        )
        return
    # Imported here, so that a run without a terminal starts faster.
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (
        # Markup would turn `:office:` in a world's name into an emoji.
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rest]}", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:

        def begin(description: str, total: int, start: int = 0) -> ProgressCallback:
            task = bar.add_task(description, total=total, completed=start, rest="")
            clock = _Clock(total, unit, start)

            def update(done: int, note: str = "", share: float | None = None) -> None:
                rest = "  ".join((*clock.figures(done, share), *filter(None, [note])))
                bar.update(task, completed=done, rest=rest)

            return update

        yield begin


class _Clock:
    """Rate and remaining time of the work."""

    def __init__(self, total: int, unit: str, start: int) -> None:
        self.total, self.unit = total, unit
        self._start, self._began = start, time.monotonic()

    def figures(self, done: int, share: float | None) -> list[str]:
        """Return rate and remaining time as text; nothing before the first step is done."""
        steps, seconds = done - self._start, time.monotonic() - self._began
        if steps <= 0 or seconds <= 0:
            return []
        # A training ends with its last rollout, which may go beyond the total.
        ahead = max(self.total - done, 0) / steps if share is None else (1 - share) / share
        left = timedelta(seconds=round(seconds * ahead))
        rate = steps / seconds
        figure = f"{rate:,.0f}" if rate >= 10 else f"{rate:.2g}"
        return [f"{figure} {self.unit}/s", f"{left} left"]


class _Lines:
    """Prints at most one line per `every` seconds, for a log."""

    def __init__(self, description: str, clock: _Clock, every: float) -> None:
        self._description, self._clock, self._every = description, clock, every
        self._told = time.monotonic()

    def __call__(self, done: int, note: str = "", share: float | None = None) -> None:
        now = time.monotonic()
        if now - self._told < self._every:
            return
        self._told = now
        parts = [f"{done:,} of {self._clock.total:,} {self._clock.unit}"]
        parts += [*self._clock.figures(done, share), *filter(None, [note])]
        click.echo(f"{self._description}: {', '.join(parts)}", err=True)
