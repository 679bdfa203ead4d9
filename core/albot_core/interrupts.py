"""Signals that end a program wait until a short piece of work is done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""What ends a program and can be heard: Ctrl-C, `kill`, a terminal that is closed."""


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Let what the block does be done whole: a signal that comes meanwhile is heard at its end.

    For short work only, such as one write. Python hears signals in the main thread alone, so
    elsewhere this does nothing, and need not.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _deferred(*INTERRUPTS):
        yield


@contextmanager
def _deferred(first: signal.Signals, *others: signal.Signals) -> Iterator[None]:
    """Defer one signal after the other, so that each comes back whatever another one breaks off."""
    heard = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal heard
        heard = True

    handler = signal.getsignal(first)
    if handler is not None:  # One that is not Python's is left alone.
        signal.signal(first, note)
    try:
        if others:
            with _deferred(*others):
                yield
        else:
            yield
    finally:
        if handler is not None:
            signal.signal(first, handler)
        if heard:
            signal.raise_signal(first)
