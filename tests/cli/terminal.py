"""A command in a terminal, by default of 80 columns and 24 rows, and a person who types in it."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Mapping
from pathlib import Path

PATIENCE = 300.0
"""So long is waited for what has to come (s)."""
MAIN = "from albot_cli.main import main; main()"


class Terminal:
    """Runs `albot` with a pseudo-terminal as its controlling one; ends what it has started."""

    def __init__(
        self,
        folder: Path,
        *arguments: str,
        code: str = MAIN,
        environment: Mapping[str, str] | None = None,
        size: tuple[int, int] = (80, 24),
    ) -> None:
        self._person, self.own_end = pty.openpty()
        fcntl.ioctl(self.own_end, termios.TIOCSWINSZ, struct.pack("HHHH", *reversed(size), 0, 0))
        self.settings = termios.tcgetattr(self.own_end)
        dropped = ("DISPLAY", "WAYLAND_DISPLAY", "COLUMNS", "LINES")
        kept = {name: value for name, value in os.environ.items() if name not in dropped}
        path = os.pathsep.join(part for part in sys.path if part)
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, *arguments],
            cwd=folder,
            env={**kept, "PYTHONPATH": path, "TERM": "xterm-256color", **(environment or {})},
            stdin=self.own_end,
            stdout=self.own_end,
            stderr=self.own_end,
            start_new_session=True,
            preexec_fn=_prepare,
        )
        self.shown = ""
        """All that the person has seen, without colours."""

    def type(self, keys: str) -> None:
        """Type; keys other than characters as terminals send them."""
        os.write(self._person, keys.encode())

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Read until this is seen after all that was waited for before."""
        deadline = time.monotonic() + PATIENCE
        while (found := re.search(pattern, self.shown)) is None:
            assert time.monotonic() < deadline, f"no {pattern} in {self.shown[-3000:]}"
            assert self.process.poll() is None or self._ready(), self.shown[-3000:]
            self._read()
        self.shown = self.shown[found.end() :]
        return found

    def finish(self) -> int:
        """Read until the command has ended; its exit status."""
        deadline = time.monotonic() + PATIENCE
        while self.process.poll() is None or self._ready():
            assert time.monotonic() < deadline, self.shown[-3000:]
            self._read()
        return self.process.returncode

    def _ready(self) -> bool:
        return bool(select.select([self._person], [], [], 0.05)[0])

    def _read(self) -> None:
        if self._ready():
            text = os.read(self._person, 65536).decode(errors="replace")
            self.shown += re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", text)

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._person)
        os.close(self.own_end)


def _prepare() -> None:
    """The terminal controls the command, and Ctrl-C interrupts it whatever our parent ignores."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    signal.signal(signal.SIGINT, signal.default_int_handler)
