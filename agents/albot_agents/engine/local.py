"""Run tasks in processes of this machine, where the death of one does not affect the others.

In the standard library, a pool breaks as a whole when one of its processes dies, without naming the
cause. Here, a new process replaces the dead one and runs the task again; if it dies each time, the
result names the step that the task had reached and the cause.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic

from albot_agents.engine.engine import (
    RERUNS,
    Crash,
    Done,
    Engine,
    Result,
    Task,
    Work,
    attempt,
    judge,
)
from albot_core.files import scratch_folder
from albot_core.garbage import collect_rarely
from albot_core.interrupts import INTERRUPTS, interrupts_deferred

CONTEXT = get_context("spawn")
"""Spawned processes behave the same on every system, and inherit no threads."""
_REMOVALS = 100
"""How often the removal of a folder is tried."""


@dataclass(frozen=True)
class LocalEngine(Engine):
    """Runs tasks in processes of this machine; between two runs there are none."""

    processes: int
    """Number of processes at a time."""

    @property
    def workers(self) -> int:
        """Number of processes at a time."""
        return self.processes

    def start(self) -> None:
        """Do nothing: the processes start with the tasks."""

    def close(self) -> None:
        """Do nothing: the processes end with the run."""

    def run(
        self, work: Work[Task, Result], tasks: Iterable[Task], *, fresh: bool = False
    ) -> Generator[Done[Task, Result], None, None]:
        """Run tasks; see `Engine.run`."""
        # A process that is killed tidies nothing up, so this one does.
        with scratch_folder() as scratch:
            yield from self._run(partial(_Worker, work, str(scratch)), tasks, fresh)

    def _run(
        self,
        begin: Callable[[_Attempt[Task]], _Worker[Task, Result]],
        tasks: Iterable[Task],
        fresh: bool,
    ) -> Generator[Done[Task, Result], None, None]:
        """Run tasks in workers; `begin` starts one with its first task."""
        waiting = (_Attempt(number, task) for number, task in enumerate(tasks))
        workers: list[_Worker[Task, Result]] = []
        try:
            for first in islice(waiting, self.processes):
                with interrupts_deferred():  # Otherwise an unknown worker could keep running.
                    workers.append(begin(first))
            while workers:
                ready = wait([worker.link for worker in workers])
                for worker in [worker for worker in workers if worker.link in ready]:
                    with interrupts_deferred():
                        done = worker.receive()
                        workers.remove(worker)
                        following = worker.again if done is None else next(waiting, None)
                        if following is not None:
                            workers.append(worker.go_on(following, fresh=fresh))
                        else:
                            worker.end()
                    if done is not None:
                        yield done
        finally:
            with interrupts_deferred():
                for worker in workers:
                    worker.end()


@dataclass(frozen=True)
class _Attempt(Generic[Task]):
    """A task that is to be run."""

    number: int
    task: Task
    tries: int = 1
    """How often it was run, this time included."""


class _Worker(Generic[Task, Result]):
    """A process that runs one task after another.

    Args:
        work: Runs each task.
        scratch: The folder for temporary files.
        first: The first task.
    """

    def __init__(self, work: Work[Task, Result], scratch: str, first: _Attempt[Task]) -> None:
        self._work, self._scratch = work, scratch
        self.link, other = CONTEXT.Pipe()
        self._step = CONTEXT.RawValue("q", 0)
        arguments = (scratch, other, self._step)
        self._process = CONTEXT.Process(target=_serve, args=arguments, daemon=True)
        with interrupts_blocked():
            self._process.start()
        other.close()  # The process has its own end; when it dies, the link breaks.
        self._attempt = first
        with suppress(ConnectionError):  # `receive` then finds that it has died.
            self.link.send(work)
            self._send(first)

    @property
    def again(self) -> _Attempt[Task]:
        """The task that the process has, to be run once more."""
        return replace(self._attempt, tries=self._attempt.tries + 1)

    def _send(self, attempt: _Attempt[Task]) -> None:
        self._attempt = attempt
        self._step.value = 0
        self.link.send(attempt.task)

    def go_on(self, following: _Attempt[Task], *, fresh: bool) -> _Worker[Task, Result]:
        """Start a task; return the worker that runs it: a new one if `fresh` or if this one died.

        The old one is ended then.
        """
        if not fresh:
            with suppress(ConnectionError):
                self._send(following)
                return self
        self.end()
        return _Worker(self._work, self._scratch, following)

    def receive(self) -> Done[Task, Result] | None:
        """Wait for the task to end; return None if the process died and it is to be run again.

        Raises:
            InputError: The task raised it.
            OSError: The task raised it.
        """
        number, task, tries = self._attempt.number, self._attempt.task, self._attempt.tries
        try:
            reply = self.link.recv()
        except (EOFError, ConnectionError):
            if tries <= RERUNS:
                return None
            self._process.join()
            cause = f"the process died: {_ending(self._process.exitcode or 0)}"
            return Done(number=number, task=task, result=Crash(
                step=int(self._step.value), cause=cause, tries=tries
            ))  # fmt: skip
        return Done(number=number, task=task, result=judge(reply))

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self.link.close()


def _ending(status: int) -> str:
    """Return how a process ended, in words."""
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"


def _serve(scratch: str, link: Connection, step: Any) -> None:
    """Run, in the worker process, the tasks that arrive through the link until it closes.

    First arrives what runs them, and with it all modules that it needs.
    """
    collect_rarely()
    tempfile.tempdir = scratch
    watcher = threading.Thread(target=_die_with_parent, args=(scratch,), daemon=True)
    watcher.start()

    def on_step(number: int) -> None:
        step.value = number

    work: Work[Any, Any] | None = None
    while True:
        try:
            received = link.recv()
        except EOFError:  # The parent has died: it ends its processes before it closes a link.
            watcher.join()
            return
        if work is None:
            work = received
        else:
            link.send(attempt(work, received, on_step))


def _die_with_parent(scratch: str) -> None:
    """End this process, whatever it is doing, when its parent process has ended.

    A parent that was killed has not removed the folder for temporary files. While it is removed, a
    task may make another file there.
    """
    parent = parent_process()
    assert parent is not None
    parent.join()
    for _ in range(_REMOVALS):
        shutil.rmtree(scratch, ignore_errors=True)
        if not os.path.lexists(scratch):
            break
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
