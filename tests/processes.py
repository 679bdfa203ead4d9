"""Processes of the command for tests of signals: they hear them, and end with the test."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
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
            try:
                yield process
            except BaseException:  # Otherwise a failed test would wait for the process to end.
                os.killpg(process.pid, signal.SIGKILL)
                raise
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


def family(pid: int) -> dict[int, Path]:
    """The folders in /proc of a process and of all that descend from it, by number."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            parents[int(folder.name)] = int(fields[1])
        except OSError:  # It has ended.
            continue
    family = {pid}
    for _ in range(4):
        family |= {each for each, parent in parents.items() if parent in family}
    return {each: Path("/proc", str(each)) for each in family}


def listening(pid: int) -> set[str]:
    """The addresses on which they listen."""
    sockets = set()
    for folder in family(pid).values():
        for file in (folder / "fd").glob("*"):
            try:
                sockets.add(str(file.readlink()))
            except OSError:
                continue
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path("/proc/net", table).read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                host, port = fields[1].split(":")
                packed = bytes.fromhex(host)
                words = [packed[k : k + 4][::-1] for k in range(0, len(packed), 4)]
                kind = socket.AF_INET if table == "tcp" else socket.AF_INET6
                name = socket.inet_ntop(kind, b"".join(words)).removeprefix("::ffff:")
                found.add(f"{name}:{int(port, 16)}")
    return found


def _hear_signals() -> None:
    """Whoever started the tests may have had them ignored, as `nohup` does."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    if _LIBC is not None:  # Should the tests themselves be killed.
        _LIBC.prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
