"""Handle Ctrl-C, `kill` and a closed terminal.

The module imports almost nothing, so that signals are handled soon after Python starts.
"""

from __future__ import annotations

import signal
import sys

TYPE_CHECKING = False  # Like typing.TYPE_CHECKING, without loading typing.
if TYPE_CHECKING:
    from sys import UnraisableHookArgs
    from types import FrameType
    from typing import NoReturn

STOPPED = 130
"""Exit status of a subcommand that was interrupted and has printed its results so far."""
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Interrupts:
    """Turns signals that end programs into KeyboardInterrupt, and records which one came.

    Code that cleans up or reports on Ctrl-C then does so on `kill` too. Signals that the caller has
    set to be ignored (`nohup`) stay ignored.
    """

    def __init__(self) -> None:
        self.heard: int | None = None
        """Number of the last signal; None if none came."""
        self._before = sys.unraisablehook

    @property
    def status(self) -> int:
        """The exit status for the signal, by the convention of shells."""
        return STOPPED if self.heard is None else 128 + self.heard

    def listen(self) -> None:
        """Raise KeyboardInterrupt from now on."""
        for number in handled_signals():
            signal.signal(number, self._stop)
        self._before, sys.unraisablehook = sys.unraisablehook, self._drop

    def end(self) -> None:
        """Let signals end the process at once, as `use_default_handlers` does, from now on."""
        use_default_handlers()
        sys.unraisablehook = self._before

    def _drop(self, dropped: UnraisableHookArgs) -> None:
        """Interrupt again soon, where an interrupt came while Python drops all exceptions.

        It does so in callbacks of C libraries, such as LLVM's while it compiles, and in `__del__`.
        """
        if self.heard is None or not isinstance(dropped.exc_value, KeyboardInterrupt):
            self._before(dropped)
            return
        import threading

        main = threading.main_thread().ident
        if sys.platform == "win32" or main is None:
            return  # There nothing can wake the main thread.
        number = self.heard

        def interrupt() -> None:
            if signal.getsignal(number) == self._stop:  # The command has not ended since.
                signal.pthread_kill(main, number)

        again = threading.Timer(0.05, interrupt)
        again.daemon = True
        again.start()

    def _stop(self, number: int, frame: FrameType | None) -> NoReturn:
        self.heard = number
        raise KeyboardInterrupt


def use_default_handlers() -> None:
    """Let signals end the process at once, without output, from now on.

    Use it when there is nothing to clean up: during imports, where an exception could be replaced
    by another or lost, and at the very end.
    """
    for number in handled_signals():
        signal.signal(number, signal.SIG_DFL)


def handled_signals() -> list[signal.Signals]:
    """Return the signals that end programs, except those that are ignored."""
    known = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    return [number for number in known if signal.getsignal(number) is not signal.SIG_IGN]
