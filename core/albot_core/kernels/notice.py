"""One line that says why the first call takes long: something is compiled.

It is a warning of the logger `albot_core.kernels`, which logging's usual means silence.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import parent_process

PATIENCE = 1.0
"""Seconds of compiling in a process after which the line is due."""
TEXT = (
    "albot: compiling, the first time only: for an environment and its mapper some 20 seconds "
    "of two free cores (`albot warm-up` does it beforehand)"
)
_logger = logging.getLogger("albot_core.kernels")


class Notice:
    """Says once in a process that compiling takes long; worker processes say nothing."""

    def __init__(self) -> None:
        self._seconds = 0.0
        self._is_given = parent_process() is not None

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Count the seconds of the block."""
        self._began = time.monotonic()
        try:
            yield
        finally:
            self._seconds += time.monotonic() - self._began

    def give_if_due(self) -> None:
        """Say it, within the block, if that is due."""
        if not self._is_given and self._seconds + time.monotonic() - self._began > PATIENCE:
            self._is_given = True
            _logger.warning(TEXT)
