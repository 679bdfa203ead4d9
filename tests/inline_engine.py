"""An engine whose tasks run in the test's own process."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any

from albot_agents.engine.engine import Done, Engine, Result, Task, Work


class InlineEngine(Engine):
    """Runs tasks in this process: sooner, and with what was changed for the test.

    Args:
        before: Called with each task before it is run; it may raise what ends the run.
        backwards: Whether the last task ends first.
    """

    def __init__(
        self, before: Callable[[Any], object] = lambda task: None, *, backwards: bool = False
    ) -> None:
        self._before, self._backwards = before, backwards

    @property
    def workers(self) -> int:
        return 1

    def start(self) -> None: ...

    def close(self) -> None: ...

    def run(
        self, work: Work[Task, Result], tasks: Iterable[Task], *, fresh: bool = False
    ) -> Generator[Done[Task, Result], None, None]:
        numbered: Iterable[tuple[int, Task]] = enumerate(tasks)
        if self._backwards:
            numbered = reversed(list(numbered))
        for number, task in numbered:
            self._before(task)
            yield Done(number=number, task=task, result=work(task, lambda step: None))


def stopping_after(count: int) -> InlineEngine:
    """An engine that Ctrl-C stops after some tasks."""
    left = count

    def stop(task: Any) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt

    return InlineEngine(stop)
