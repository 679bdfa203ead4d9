"""Going through the seeds of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from albot_core.errors import InputError


def one_by_one(seeds: range, progress: Callable[[int], None]) -> Iterator[int]:
    """The seeds one after the other; `progress` is told how many are done.

    Raises:
        InputError: No seeds.
    """
    if not len(seeds):
        raise InputError("seeds", "at least one", "none")
    for done, seed in enumerate(seeds, start=1):
        yield seed
        progress(done)
