"""A progress bar on the terminal, and nothing where there is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Tell(Protocol):
    """Is told how far a work has come."""

    def __call__(self, done: int, note: str = "") -> None:
        """So many steps are done; the note says how it goes."""


@contextmanager
def progress(description: str, total: int, unit: str = "", *, start: int = 0) -> Iterator[Tell]:
    """Show how far a long work has come, at what rate, and how long it will still take.

    The bar is drawn on stderr, and only if that is a terminal.

    Args:
        description: What is being done.
        total: How many steps it takes.
        unit: What a step is called, in the plural.
        start: How many steps were done before.

    Yields:
        What is to be called with the number of steps done so far.
    """
    if not sys.stderr.isatty():
        yield _tell_nobody
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
            rate = f"{(done - start) / seconds:,.0f} {unit}/s" if seconds else ""
            bar.update(task, completed=done, rate=rate, note=note)

        yield tell


def _tell_nobody(done: int, note: str = "") -> None:
    """Where nobody looks on."""
