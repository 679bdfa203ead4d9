"""Ctrl-C, `kill` and a terminal that is closed: what the command does about them.

It imports next to nothing, so that it is there soon after Python is.
"""

from __future__ import annotations

import signal

TYPE_CHECKING = False  # As typing's, which would have to be loaded.
if TYPE_CHECKING:
    from types import FrameType
    from typing import NoReturn

STOPPED = 130
"""Exit status of a subcommand that was interrupted and has told what there is."""
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Interrupts:
    """Turns signals that end programs into KeyboardInterrupt, and keeps which one it was.

    So whoever tidies up, or tells what there is, where Ctrl-C ends the work does so where
    `kill` does. A signal that we were told to ignore (`nohup`) stays ignored.
    """

    def __init__(self) -> None:
        self.heard: int | None = None
        """The number of the last signal that came; None where none did."""

    @property
    def status(self) -> int:
        """The exit status of a program that such a signal has ended, as shells know it."""
        return STOPPED if self.heard is None else 128 + self.heard

    def listen(self) -> None:
        """Raise KeyboardInterrupt from now on."""
        for number in heeded():
            signal.signal(number, self._stop)

    def _stop(self, number: int, frame: FrameType | None) -> NoReturn:
        self.heard = number
        raise KeyboardInterrupt


def die_quietly() -> None:
    """From now on a signal ends the process at once and without a word.

    For when there is nothing to tidy up: while modules are imported, where an exception might
    come out as any other or be lost, and at the very end.
    """
    for number in heeded():
        signal.signal(number, signal.SIG_DFL)


def heeded() -> list[signal.Signals]:
    """The signals that end programs, but those that we were told to ignore."""
    known = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in known if signal.getsignal(number) is not signal.SIG_IGN]
