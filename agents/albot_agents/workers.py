"""Run tasks in parallel processes, where the death of one process does not affect the others.

In the standard library, a pool breaks as a whole when one of its processes dies, without naming the
cause. Here, a new process replaces the dead one, and the result names the step that the task had
reached and the cause.
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

CONTEXT = get_context("spawn")
"""Spawned processes behave the same on every system, and inherit no threads."""

Task = TypeVar("Task")
Result = TypeVar("Result")


class TaskRunner(ABC, Generic[Task, Result]):
    """Runs tasks in a worker process. It is pickled and sent to every process."""

    @abstractmethod
    def run(self, task: Task, on_step: Callable[[int], None]) -> Result:
        """Run a task; call `on_step` with the number of each step before it is taken."""

    @abstractmethod
    def on_crash(self, task: Task, step: int, cause: str) -> Result:
        """Return the result of a task whose process died in step `step`; `cause` says of what."""


def run_parallel(
    runner: TaskRunner[Task, Result], tasks: Iterable[Task], jobs: int, *, fresh: bool = False
) -> Generator[Result, None, None]:
    """Yield the results of tasks in the order in which they finish.

    Closing the iterator ends all processes.

    Args:
        runner: Runs each task.
        tasks: The tasks.
        jobs: Number of processes at a time.
        fresh: Whether each task gets a new process, so that its memory use can be measured.
    """
    waiting = iter(tasks)
    workers: list[_Worker[Task, Result]] = []
    try:
        for task in islice(waiting, jobs):
            with interrupts_deferred():  # Otherwise an unknown worker could keep running.
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
    """A process that runs one task after another.

    Args:
        runner: Runs each task.
        task: The first task.
    """

    def __init__(self, runner: TaskRunner[Task, Result], task: Task) -> None:
        self._runner = runner
        self.link, other = CONTEXT.Pipe()
        self._step = CONTEXT.RawValue("q", 0)
        arguments = (runner, other, self._step)
        self._process = CONTEXT.Process(target=_serve, args=arguments, daemon=True)
        with interrupts_blocked():
            self._process.start()
        other.close()  # The process has its own end; when it dies, the link breaks.
        with suppress(ConnectionError):  # `receive` then finds that it has died.
            self._send(task)

    def _send(self, task: Task) -> None:
        self._task = task
        self._step.value = 0
        self.link.send(task)

    def start(self, task: Task) -> _Worker[Task, Result]:
        """Start a task; return the worker that runs it: a new one if this process has died."""
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
    """Run, in the worker process, the tasks that arrive through the link until it closes."""
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
    """End this process, whatever it is doing, when its parent process has ended."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block SIGINT and SIGTERM for processes started meanwhile; their parent ends them."""
    if sys.platform == "win32":
        yield
        return
    # The first process started also starts the standard library's resource tracker, which
    # unblocks the signals again; so the tracker must already run.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
