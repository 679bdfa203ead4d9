"""The keyboard of a terminal: keys as they are typed, not echoed, and none left for the shell."""

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
except ImportError:  # Windows has neither; there a terminal shows, and hears no keys.
    termios = None  # type: ignore[assignment]

HOLD = 0.6
"""So long is a key taken to be held (s): terminals tell only that it was typed, and repeat one
that is held after half a second."""

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
"""Our names of what terminals send; `ESC O` stands for `ESC [`."""


class TerminalKeyboard:
    """Reads keys from standard input, if that is a terminal, without waiting for them."""

    def __init__(self) -> None:
        self._typed_at: dict[str, float] = {}
        self._rest = ""
        self._settings: list[Any] | None = None
        self._stdin, self._ours = -1, False
        if termios is not None and sys.stdin is not None and sys.stdin.isatty():
            self._stdin = sys.stdin.fileno()
            self._settings = termios.tcgetattr(self._stdin)
            atexit.register(self.close)
            # By itself it ends a process without a word, and the terminal stays as it is.
            in_main = threading.current_thread() is threading.main_thread()
            self._ours = in_main and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
            if self._ours:
                signal.signal(signal.SIGTERM, _leave)
            tty.setcbreak(self._stdin, termios.TCSANOW)

    @property
    def there(self) -> bool:
        """Whether there is somebody who can type."""
        return self._settings is not None

    def keys(self) -> Sequence[str]:
        """The names of the keys typed since the last call; `q` where the terminal has gone."""
        if not self.there or not select.select([self._stdin], [], [], 0)[0]:
            return ()
        typed = b""
        with suppress(OSError):  # The terminal has gone: as if nothing came any more.
            typed = os.read(self._stdin, 4096)
        if not typed:
            return ("q",)
        names = self._names(typed.decode(errors="replace"))
        self._typed_at |= dict.fromkeys(names, time.monotonic())
        return names

    def held(self) -> frozenset[str]:
        """The names of the keys typed within `HOLD`."""
        since = time.monotonic() - HOLD
        return frozenset(name for name, at in self._typed_at.items() if at > since)

    def close(self) -> None:
        """Put the terminal's settings back; what was typed and not read is dropped."""
        if self._settings is not None:
            with suppress(termios.error):  # The terminal has gone.
                termios.tcsetattr(self._stdin, termios.TCSAFLUSH, self._settings)
            self._settings = None
            atexit.unregister(self.close)
            if self._ours:
                signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def _names(self, typed: str) -> list[str]:
        """Names of keys; the beginning of one whose end is still to come is kept for later."""
        typed = self._rest + typed
        unfinished = _UNFINISHED.search(typed)
        self._rest = "" if unfinished is None else unfinished[0]
        typed = typed[: len(typed) - len(self._rest)]
        sequences = (found[0].replace("\x1bO", "\x1b[") for found in _KEY.finditer(typed))
        return [_NAMES.get(sequence, sequence) for sequence in sequences if sequence != "\x1b"]


def _leave(number: int, frame: object) -> NoReturn:
    """End the process as shells know it that a signal has ended, and tidy up on the way."""
    sys.exit(128 + number)
