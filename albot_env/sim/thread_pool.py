"""The thread pool: threads that share work on arrays; each processes some of the rows."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError
from albot_core.ranges import Range

MIN_ROWS_PER_THREAD = 32
"""Minimum number of rows for which an extra thread pays off."""
_SIZES = Range("a whole number from 1", 1.0, whole=True)


def check_threads(size: int | None) -> None:
    """Check a number of threads; None is for as many as there are processors.

    Raises:
        InputError: It is not a whole number from 1.
    """
    if size is not None and size not in _SIZES:
        raise InputError("threads", f"{_SIZES.expected}, or None", str(size))


class ThreadPool:
    """Threads that share work. Compiled code releases the GIL, so the threads run in parallel.

    Args:
        size: Number of threads; None for the number of processors that this process may use.

    Raises:
        InputError: `size` is not a whole number from 1.
    """

    def __init__(self, size: int | None) -> None:
        check_threads(size)
        self.size = size or processors()
        self._pool: ThreadPoolExecutor | None = None
        self._owner = 0

    def share(
        self,
        rows: Int64[np.ndarray, "rows"],
        work: Callable[[Int64[np.ndarray, "some"], int], None],
        min_rows: int = 1,
    ) -> None:
        """Split the rows among the threads and call `work(rows, thread number)` in each.

        Args:
            rows: The rows. Results must not depend on which thread gets which rows.
            work: The work. An exception that it raises is raised here.
            min_rows: Minimum number of rows for which an extra thread pays off.
        """
        threads = min(self.size, max(1, len(rows) // min_rows))
        if threads == 1:
            work(rows, 0)
            return
        if self._pool is None or self._owner != os.getpid():  # A fork does not copy threads.
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
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
