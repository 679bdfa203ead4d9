"""Defer signals that end a program until a short piece of work is done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Signals that end a program and can be handled: Ctrl-C, `kill`, a closed terminal."""


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defer signals that arrive in the block to its end, so that the block completes.

    Use it for short work only, such as one write. Python handles signals only in the main thread,
    so in other threads this does nothing and is not needed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _deferred(*INTERRUPTS):
        yield


@contextmanager
def _deferred(first: signal.Signals, *others: signal.Signals) -> Iterator[None]:
    """Defer signals in nested blocks, so that each handler is restored even if another raises."""
    heard = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal heard
        heard = True

    handler = signal.getsignal(first)
    if handler is not None:  # A handler that is not Python's is kept.
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
