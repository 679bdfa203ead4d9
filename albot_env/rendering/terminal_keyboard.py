"""The keyboard of a terminal: keys are read as typed, not echoed, and not left for the shell."""

from __future__ import annotations

import atexit
import os
import re
import select
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NoReturn

try:
    import termios
    import tty
except ImportError:  # Windows has neither: its terminals show frames but read no keys.
    termios = None  # type: ignore[assignment]

HOLD = 0.6
"""Time that a key counts as held (s). Terminals report only that a key was typed, and repeat a
held key after half a second."""

_KEY = re.compile(r"\x1b(?:\[[\d;]*|O)[A-Za-z~]|.", re.DOTALL)
_UNFINISHED = re.compile(r"\x1b(?:\[[\d;]*|O)?\Z")
_NAMES = {
    "\x1b[A": "up",
    "\x1b[B": "down",
    "\x1b[C": "right",
    "\x1b[D": "left",
    "\x1b[H": "home",
    "\x1b[F": "end",
    "\x1b[1~": "home",
    "\x1b[7~": "home",
    "\x1b[4~": "end",
    "\x1b[8~": "end",
    " ": "space",
    "\r": "enter",
    "\n": "enter",
}
"""Key names for the sequences that terminals send; `ESC O` stands for `ESC [`."""


class TerminalKeyboard:
    """Reads keys from standard input without waiting, if it is a terminal."""

    def __init__(self) -> None:
        self._typed_at: dict[str, float] = {}
        self._rest = ""
        self._settings: list[Any] | None = None
        self._stdin, self._ours = -1, False
        if termios is not None and sys.stdin is not None and sys.stdin.isatty():
            self._stdin = sys.stdin.fileno()
            self._settings = termios.tcgetattr(self._stdin)
            atexit.register(self.close)
            # By default this signal ends a process at once, without restoring the terminal.
            in_main = threading.current_thread() is threading.main_thread()
            self._ours = in_main and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
            if self._ours:
                signal.signal(signal.SIGTERM, _leave)
            tty.setcbreak(self._stdin, termios.TCSANOW)

    @property
    def there(self) -> bool:
        """Whether there is a terminal to read keys from."""
        return self._settings is not None

    def keys(self) -> Sequence[str]:
        """Return the names of the keys typed since the last call; `q` if the terminal is gone."""
        if not self.there or not select.select([self._stdin], [], [], 0)[0]:
            return ()
        typed = b""
        with suppress(OSError):  # The terminal is gone: read nothing.
            typed = os.read(self._stdin, 4096)
        if not typed:
            return ("q",)
        names = self._names(typed.decode(errors="replace"))
        self._typed_at |= dict.fromkeys(names, time.monotonic())
        return names

    def held(self) -> frozenset[str]:
        """Return the names of the keys typed within `HOLD`."""
        since = time.monotonic() - HOLD
        return frozenset(name for name, at in self._typed_at.items() if at > since)

    def close(self) -> None:
        """Restore the terminal's settings; unread keys are dropped."""
        if self._settings is not None:
            with suppress(termios.error):  # The terminal is gone.
                termios.tcsetattr(self._stdin, termios.TCSAFLUSH, self._settings)
            self._settings = None
            atexit.unregister(self.close)
            if self._ours:
                signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def _names(self, typed: str) -> list[str]:
        """Return the names of keys; an incomplete sequence at the end is kept for later."""
        typed = self._rest + typed
        unfinished = _UNFINISHED.search(typed)
        self._rest = "" if unfinished is None else unfinished[0]
        typed = typed[: len(typed) - len(self._rest)]
        sequences = (found[0].replace("\x1bO", "\x1b[") for found in _KEY.finditer(typed))
        return [_NAMES.get(sequence, sequence) for sequence in sequences if sequence != "\x1b"]


def _leave(number: int, frame: object) -> NoReturn:
    """Clean up and end the process with the exit status that shells expect after a signal."""
    sys.exit(128 + number)
