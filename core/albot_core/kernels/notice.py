"""A warning that the first call takes long because code is compiled.

Its logger is `albot_core.kernels`, which the settings of `logging` can silence.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import parent_process

PATIENCE = 1.0
"""Time spent on compiling in a process after which the warning is given (s)."""
TEXT = (
    "albot: compiling, the first time only: for an environment and its mapper some 20 seconds "
    "of two free cores (`albot warm-up` does it beforehand)"
)
_logger = logging.getLogger("albot_core.kernels")


class Notice:
    """Warns once per process that compiling takes long; worker processes do not warn."""

    def __init__(self) -> None:
        self._seconds = 0.0
        self._is_given = parent_process() is not None

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Add the duration of the block to the time spent on compiling."""
        self._began = time.monotonic()
        try:
            yield
        finally:
            self._seconds += time.monotonic() - self._began

    def give_if_due(self) -> None:
        """Give the warning if it is due; call this within the block."""
        if not self._is_given and self._seconds + time.monotonic() - self._began > PATIENCE:
            self._is_given = True
            _logger.warning(TEXT)
