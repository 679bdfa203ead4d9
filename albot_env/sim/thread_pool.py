"""The thread pool: threads that share work on arrays, each doing some of the rows."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError
from albot_core.ranges import Range

MIN_ROWS_PER_THREAD = 32
"""Rows below which a thread of its own costs more than it brings."""
_SIZES = Range("a whole number from 1", 1.0, whole=True)


class ThreadPool:
    """Threads that share work. Compiled code lets go of Python's lock, so they run at once.

    Args:
        size: How many threads; None for as many as this process may use processors.

    Raises:
        InputError: No whole number, or fewer than one.
    """

    def __init__(self, size: int | None) -> None:
        if size is not None and size not in _SIZES:
            raise InputError("threads", f"{_SIZES.expected}, or None", str(size))
        self.size = size or processors()
        self._pool: ThreadPoolExecutor | None = None
        self._owner = 0

    def share(
        self,
        rows: Int64[np.ndarray, "rows"],
        work: Callable[[Int64[np.ndarray, "some"], int], None],
        min_rows: int = 1,
    ) -> None:
        """Let every thread work on some of the rows: `work(rows, number of the thread)`.

        Args:
            rows: The rows; which thread gets which makes no difference to what comes of it.
            work: The work. What it raises is raised here.
            min_rows: Fewest rows for which a thread of its own pays.
        """
        threads = min(self.size, max(1, len(rows) // min_rows))
        if threads == 1:
            work(rows, 0)
            return
        if self._pool is None or self._owner != os.getpid():  # A fork leaves threads behind.
            self._owner = os.getpid()
            self._pool = ThreadPoolExecutor(self.size - 1, thread_name_prefix="albot")
        parts = np.array_split(rows, threads)
        others = [self._pool.submit(work, part, k) for k, part in enumerate(parts) if k]
        try:
            work(parts[0], 0)
        finally:
            wait(others)
        for other in others:
            other.result()

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None and self._owner == os.getpid():
            self._pool.shutdown()
        self._pool = None


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
