"""Report the progress of long work: a bar on a terminal, otherwise occasional lines."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Protocol

import click

EVERY = 60.0
"""Time between two lines without a terminal (s)."""


class ProgressCallback(Protocol):
    """Receives the progress."""

    def __call__(self, done: int, note: str = "") -> None:
        """Report that `done` steps are done; `note` describes the state."""


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

    It goes to stderr: as a bar if that is a terminal, otherwise as lines.

    Args:
        description: Name of the work.
        total: Total number of steps.
        unit: Name of a step, in the plural.
        start: Number of steps done before.
        every: Time between two lines (s); by default `EVERY`.

    Yields:
        A callable that takes the number of steps done so far.
    """
    if not sys.stderr.isatty():
        yield _Lines(description, total, unit, start, EVERY if every is None else every)
        return
    # Imported here, so that a run without a terminal starts faster.
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        # Markup would turn `:office:` in a world's name into an emoji.
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[note]}", markup=False),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=total, completed=start, rate="", note="")

        def update(done: int, note: str = "") -> None:
            seconds = bar.tasks[task].elapsed
            rate = _rate(done - start, seconds, unit) if seconds else ""
            bar.update(task, completed=done, rate=rate, note=note)

        yield update


class _Lines:
    """Prints at most one line per `every` seconds, for a log."""

    def __init__(self, description: str, total: int, unit: str, start: int, every: float) -> None:
        self._description, self._total, self._unit = description, total, unit
        self._start, self._every = start, every
        self._began = self._told = time.monotonic()

    def __call__(self, done: int, note: str = "") -> None:
        now = time.monotonic()
        if now - self._told < self._every:
            return
        self._told, steps, seconds = now, done - self._start, now - self._began
        parts = [f"{done:,} of {self._total:,} {self._unit}"]
        if steps:
            left = timedelta(seconds=round(seconds * (self._total - done) / steps))
            parts += [_rate(steps, seconds, self._unit), f"{left} left"]
        click.echo(f"{self._description}: {', '.join((*parts, *filter(None, [note])))}", err=True)


def _rate(steps: int, seconds: float, unit: str) -> str:
    rate = steps / seconds
    return f"{rate:,.0f} {unit}/s" if rate >= 10 else f"{rate:.2g} {unit}/s"
