"""A progress bar on the terminal, and nothing where there is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress(description: str, total: int, unit: str = "") -> Iterator[Callable[[int], None]]:
    """Show how far a long work has come, at what rate, and how long it will still take.

    The bar is drawn on stderr, and only if that is a terminal.

    Args:
        description: What is being done.
        total: How many steps it takes.
        unit: What a step is called, in the plural.

    Yields:
        What is to be called with the number of steps done so far.
    """
    if not sys.stderr.isatty():
        yield lambda done: None
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
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=total, rate="")

        def tell(done: int) -> None:
            seconds = bar.tasks[task].elapsed
            rate = f"{done / seconds:,.0f} {unit}/s" if seconds else ""
            bar.update(task, completed=done, rate=rate)

        yield tell
