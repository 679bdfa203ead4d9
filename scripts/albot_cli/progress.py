"""How far a long work has come: a bar on a terminal, a line now and then where there is none."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Protocol

import click

EVERY = 60.0
"""Seconds between two lines where there is no terminal."""


class Tell(Protocol):
    """Is told how far a work has come."""

    def __call__(self, done: int, note: str = "") -> None:
        """So many steps are done; the note says how it goes."""


@contextmanager
def progress(
    description: str,
    total: int,
    unit: str = "",
    *,
    start: int = 0,
    every: float | None = None,
) -> Iterator[Tell]:
    """Show how far a long work has come, at what rate, and how long it will still take.

    On stderr: a bar if that is a terminal, and lines if not.

    Args:
        description: What is being done.
        total: How many steps it takes.
        unit: What a step is called, in the plural.
        start: How many steps were done before.
        every: Seconds between two lines; by default `EVERY`.

    Yields:
        What is to be called with the number of steps done so far.
    """
    if not sys.stderr.isatty():
        yield _Lines(description, total, unit, start, EVERY if every is None else every)
        return
    # Imported here, so that a run without a terminal starts sooner.
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        # Without markup, in which `:office:` of a world's name would be a picture.
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[note]}", markup=False),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=total, completed=start, rate="", note="")

        def tell(done: int, note: str = "") -> None:
            seconds = bar.tasks[task].elapsed
            rate = _rate(done - start, seconds, unit) if seconds else ""
            bar.update(task, completed=done, rate=rate, note=note)

        yield tell


class _Lines:
    """A line at most every so many seconds, for a log."""

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
