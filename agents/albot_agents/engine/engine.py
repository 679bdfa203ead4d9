"""The interface of an engine: run independent tasks, and yield each result when it is there.

A task is run by a function, the *work*, in a process of the engine. The results are the same to the
last bit whatever the engine and its number of workers; only the order in which they come differs.
"""

from __future__ import annotations

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from albot_core.errors import InputError

RERUNS = 3
"""How often a task whose process died is run again, in another process."""

Task = TypeVar("Task")
Result = TypeVar("Result")

OnStep = Callable[[int], None]
"""Takes the number of each step of a task before it is taken."""
Work = Callable[[Task, OnStep], Result]
"""Runs a task in a worker process and returns its result; it calls `on_step` with the number of
each step before it is taken. It is pickled and sent there, a function by its name."""


@dataclass(frozen=True, kw_only=True)
class Crash:
    """Why a task has no result: its process died each time, or it raised an error that is a bug."""

    step: int | None
    """Number of the step in which it happened; None if that is not known."""
    cause: str
    """What happened, in one line."""
    tries: int
    """How often the task was run."""
    details: str = ""
    """The traceback of an error."""

    def __str__(self) -> str:
        """Return it in one line."""
        where = "" if self.step is None else f"step {self.step}: "
        return f"{where}{self.cause}{f', {self.tries} times' if self.tries > 1 else ''}"


@dataclass(frozen=True, kw_only=True)
class Done(Generic[Task, Result]):
    """A task that has ended."""

    number: int
    """Number of the task, counted from 0 in the order in which the engine was given the tasks."""
    task: Task
    """The task."""
    result: Result | Crash
    """Its result, or why there is none."""

    def required(self, name: str) -> Result:
        """Return the result of a task that must not crash.

        Args:
            name: Name of the task, for the error.

        Raises:
            RuntimeError: It crashed.
        """
        if isinstance(self.result, Crash):
            details = f"\n{self.result.details}" if self.result.details else ""
            raise RuntimeError(f"{name}, {self.result}{details}")
        return self.result


class Engine(ABC):
    """Runs independent tasks. As a context, it ends all that it started when the block ends."""

    @property
    @abstractmethod
    def workers(self) -> int:
        """Number of tasks that run at a time."""

    @abstractmethod
    def start(self) -> None:
        """Start what takes long to start, once; `run` does so, too.

        Raises:
            InputError: It cannot be started.
        """

    @abstractmethod
    def run(
        self, work: Work[Task, Result], tasks: Iterable[Task], *, fresh: bool = False
    ) -> Generator[Done[Task, Result], None, None]:
        """Yield each task when it has ended; the order depends on how long each takes.

        A task whose process died is run again in another process, `RERUNS` times at most. Closing
        the iterator ends all running tasks.

        Args:
            work: Runs each task.
            tasks: The tasks; each is taken when it is about to be run.
            fresh: Whether each task gets a new process, so that its memory use can be measured.

        Raises:
            InputError: A task raised it, or the engine cannot be started.
            OSError: A task raised it, as one does when the disk is full.
        """

    @abstractmethod
    def close(self) -> None:
        """End all that the engine started."""

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


@dataclass(frozen=True, kw_only=True)
class Failure:
    """What a worker process sends in place of a result that is not there."""

    error: InputError | OSError | None = None
    """The error that ends the run; None for a bug."""
    crash: Crash | None = None
    """The bug."""


def attempt(work: Work[Task, Result], task: Task, on_step: OnStep) -> Result | Failure:
    """Run a task in this process; return its result, or the failure that it ended with."""
    step: int | None = None

    def note(number: int) -> None:
        nonlocal step
        step = number
        on_step(number)

    try:
        return work(task, note)
    except (InputError, OSError) as error:
        return Failure(error=error)
    except Exception as error:  # noqa: BLE001  (any other error is a bug of the task)
        details = "".join(traceback.format_exception(error))
        return Failure(crash=Crash(step=step, cause=name_error(error), tries=1, details=details))


def name_error(error: BaseException) -> str:
    """Return an error and the place where it was raised, in one line."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {' '.join(str(error).split())}{place}"


def judge(reply: Result | Failure) -> Result | Crash:
    """Return what `attempt` sent as the result of a `Done`.

    Raises:
        InputError: The task raised it.
        OSError: The task raised it.
    """
    if not isinstance(reply, Failure):
        return reply
    if reply.error is not None:
        raise reply.error
    assert reply.crash is not None
    return reply.crash
