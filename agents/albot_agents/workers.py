"""Work in parallel processes, one of which may die without taking the others along."""

from __future__ import annotations

import signal
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

_CONTEXT = get_context("spawn")
"""Processes that begin anew are the same on every system, and inherit no threads."""


Task = TypeVar("Task")
Outcome = TypeVar("Outcome")


class Trade(ABC, Generic[Task, Outcome]):
    """What worker processes do; it is pickled."""

    @abstractmethod
    def work(self, task: Task, tell: Callable[[int], None]) -> Outcome:
        """Do a task; `tell` is called with the number of each step of it before it is taken."""

    @abstractmethod
    def died(self, task: Task, step: int, cause: str) -> Outcome:
        """What becomes of a task in whose step of this number the process died."""


def run_parallel(
    trade: Trade[Task, Outcome], tasks: Iterable[Task], jobs: int
) -> Generator[Outcome, None, None]:
    """What becomes of tasks, in the order in which they are done.

    Leaving the iterator ends all processes.

    Args:
        trade: What is to be done with each.
        tasks: The tasks.
        jobs: How many are done at once.
    """
    waiting = iter(tasks)
    workers = [_Worker(trade, task) for task in islice(waiting, jobs)]
    try:
        while workers:
            told = wait([worker.link for worker in workers])
            for worker in [worker for worker in workers if worker.link in told]:
                outcome = worker.outcome()
                workers.remove(worker)
                following = next(waiting, None)
                if following is None:
                    worker.end()
                else:
                    workers.append(worker.given(following))
                yield outcome
    finally:
        for worker in workers:
            worker.end()


class _Worker(Generic[Task, Outcome]):
    """A process that does one task after another.

    Args:
        trade: What it does.
        task: The first task.
    """

    def __init__(self, trade: Trade[Task, Outcome], task: Task) -> None:
        self._trade = trade
        self.link, other = _CONTEXT.Pipe()
        self._step = _CONTEXT.RawValue("q", 0)
        self._process = _CONTEXT.Process(target=_work, args=(trade, other, self._step), daemon=True)
        with _unheard_interrupts():
            self._process.start()
        other.close()  # The process has its own: when it dies, the link breaks.
        self._begin(task)

    def _begin(self, task: Task) -> None:
        self._task = task
        self._step.value = 0
        self.link.send(task)

    def given(self, task: Task) -> _Worker[Task, Outcome]:
        """The worker that does this task next: another one where this has died."""
        try:
            self._begin(task)
        except ConnectionError:
            self.end()
            return _Worker(self._trade, task)
        return self

    def outcome(self) -> Outcome:
        """What became of the task, as soon as the process tells or has died."""
        try:
            outcome: Outcome = self.link.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            what = f"the process died: {_cause(self._process.exitcode or 0)}"
            return self._trade.died(self._task, int(self._step.value), what)
        return outcome

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self.link.close()


def _work(trade: Trade[Any, Any], link: Connection, step: Any) -> None:
    """Do the tasks that come through the link, until there are no more."""

    def tell(number: int) -> None:
        step.value = number

    while True:
        try:
            task = link.recv()
        except EOFError:
            return
        link.send(trade.work(task, tell))


def _cause(status: int) -> str:
    """What an exit status means."""
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"


@contextmanager
def _unheard_interrupts() -> Iterator[None]:
    """Processes started meanwhile never hear Ctrl-C: the one that started them ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Only the main thread hears it and may say who else does.
        return
    heard = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, heard)
