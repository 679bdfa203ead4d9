"""Processes of the command for tests of signals: they hear them, and end with the test."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

ALBOT = (sys.executable, "-c", "from albot_cli.main import main; main()")
"""The command, as its console script calls it."""
_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None
_SET_PARENT_DEATH_SIGNAL = 1
"""`PR_SET_PDEATHSIG` of prctl(2)."""


@contextmanager
def running(
    command: Sequence[str | Path],
    folder: Path,
    environment: Mapping[str, str] | None = None,
    **options: Any,
) -> Iterator[subprocess.Popen[bytes]]:
    """A process in a session of its own, all of whose processes are killed in the end.

    Args:
        command: Its words.
        folder: Where it runs.
        environment: Its variables. [default: ours]
        options: Others of `subprocess.Popen`.
    """
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment or known_paths(),
        start_new_session=True,
        preexec_fn=_hear_signals,
        **settings,
    )
    try:
        with process:
            yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def known_paths() -> dict[str, str]:
    """Our environment, in which Python finds what it finds here."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def wait_until(holds: Callable[[], bool], seconds: float = 120) -> None:
    """Wait until something holds, or fail."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def is_gone(session: int) -> bool:
    """Whether no process of a session is left."""
    try:
        os.killpg(session, 0)
    except ProcessLookupError:
        return True
    return False


def _hear_signals() -> None:
    """Whoever started the tests may have had them ignored, as `nohup` does."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    if _LIBC is not None:  # Should the tests themselves be killed.
        _LIBC.prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
