"""Tasks in parallel processes, one of which may die without taking the others along.

A pool of the standard library breaks as a whole where one of its processes dies, and does not say
of what. Here a new process takes the dead one's place, and the task comes back with the step that
it had reached and the cause.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

from albot_core.interrupts import INTERRUPTS, interrupts_deferred

_CONTEXT = get_context("spawn")
"""Processes that begin anew are the same on every system, and inherit no threads."""

Task = TypeVar("Task")
Result = TypeVar("Result")


class TaskRunner(ABC, Generic[Task, Result]):
    """What worker processes do with each task. It is pickled and sent to every process."""

    @abstractmethod
    def run(self, task: Task, on_step: Callable[[int], None]) -> Result:
        """Run a task; `on_step` is called with the number of each step before it is taken."""

    @abstractmethod
    def on_crash(self, task: Task, step: int, cause: str) -> Result:
        """The result of a task in whose step of this number the process died."""


def run_parallel(
    runner: TaskRunner[Task, Result], tasks: Iterable[Task], jobs: int, *, fresh: bool = False
) -> Generator[Result, None, None]:
    """The results of tasks, in the order in which they are done.

    Leaving the iterator ends all processes.

    Args:
        runner: What is done with each task.
        tasks: The tasks.
        jobs: How many are done at once.
        fresh: Whether each task gets a process of its own, so that the memory that it takes can be
            measured.
    """
    waiting = iter(tasks)
    workers: list[_Worker[Task, Result]] = []
    try:
        for task in islice(waiting, jobs):
            with interrupts_deferred():  # Or a worker would run on that nobody knows of.
                workers.append(_Worker(runner, task))
        while workers:
            ready = wait([worker.link for worker in workers])
            for worker in [worker for worker in workers if worker.link in ready]:
                with interrupts_deferred():
                    result = worker.receive()
                    workers.remove(worker)
                    following = next(waiting, None)
                    if following is None or fresh:
                        worker.end()
                    if following is not None and fresh:
                        workers.append(_Worker(runner, following))
                    elif following is not None:
                        workers.append(worker.start(following))
                yield result
    finally:
        with interrupts_deferred():
            for worker in workers:
                worker.end()


class _Worker(Generic[Task, Result]):
    """A process that does one task after another.

    Args:
        runner: What it does with each.
        task: The first task.
    """

    def __init__(self, runner: TaskRunner[Task, Result], task: Task) -> None:
        self._runner = runner
        self.link, other = _CONTEXT.Pipe()
        self._step = _CONTEXT.RawValue("q", 0)
        arguments = (runner, other, self._step)
        self._process = _CONTEXT.Process(target=_serve, args=arguments, daemon=True)
        with _blocked_interrupts():
            self._process.start()
        other.close()  # The process has its own: when it dies, the link breaks.
        with suppress(ConnectionError):  # Whoever receives finds that it has died.
            self._send(task)

    def _send(self, task: Task) -> None:
        self._task = task
        self._step.value = 0
        self.link.send(task)

    def start(self, task: Task) -> _Worker[Task, Result]:
        """Start a task; the worker that does it: another one where this has died."""
        try:
            self._send(task)
        except ConnectionError:
            self.end()
            return _Worker(self._runner, task)
        return self

    def receive(self) -> Result:
        """Wait for the result of the task, or for the process to die."""
        try:
            result: Result = self.link.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            status = self._process.exitcode or 0
            died = (
                f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
            )
            cause = f"the process died: {died}"
            return self._runner.on_crash(self._task, int(self._step.value), cause)
        return result

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self.link.close()


def _serve(runner: TaskRunner[Any, Any], link: Connection, step: Any) -> None:
    """In the process: run the tasks that come through the link, until there are no more."""
    threading.Thread(target=_die_with_parent, daemon=True).start()

    def on_step(number: int) -> None:
        step.value = number

    while True:
        try:
            task = link.recv()
        except EOFError:
            return
        link.send(runner.run(task, on_step))


def _die_with_parent() -> None:
    """End this process, whatever it is doing, when the one that started it is no more."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def _blocked_interrupts() -> Iterator[None]:
    """Processes started meanwhile never hear Ctrl-C or `kill`: who started them ends them."""
    if sys.platform == "win32":
        yield
        return
    # The first process started brings the standard library's tracker of resources along, and
    # starting that one unblocks the signals again: it has to be there before.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
