"""Tasks in parallel processes: what those hear."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from albot_agents.workers import TaskRunner, run_parallel
from albot_core.interrupts import INTERRUPTS
from tests.processes import running


class BlockedSignals(TaskRunner[int, list[str]]):
    """Tells which signals do not reach the process."""

    def run(self, task: int, on_step: Callable[[int], None]) -> list[str]:
        return sorted(signal.Signals(n).name for n in signal.pthread_sigmask(signal.SIG_BLOCK, ()))

    def on_crash(self, task: int, step: int, cause: str) -> list[str]:
        return [cause]


@pytest.mark.skipif(sys.platform == "win32", reason="signals cannot be blocked there")
def test_no_worker_hears_signals_not_even_the_first(tmp_path: Path) -> None:
    """In a process that has started no other one yet: with the first comes a tracker."""
    code = (
        "from albot_agents.workers import run_parallel;"
        "from tests.agents.test_workers import BlockedSignals;"
        "print(list(run_parallel(BlockedSignals(), range(3), 1)))"
    )
    with running([sys.executable, "-c", code], tmp_path) as process:
        out, errors = process.communicate(timeout=60)
    blocked = sorted(number.name for number in INTERRUPTS)
    assert (errors, out.decode().strip()) == (b"", str([blocked] * 3))


def test_signals_reach_us_again_once_workers_are_started() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    list(run_parallel(BlockedSignals(), range(2), 2))
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before


class ProcessIds(TaskRunner[int, int]):
    """Tells in which process a task was done."""

    def run(self, task: int, on_step: Callable[[int], None]) -> int:
        return os.getpid()

    def on_crash(self, task: int, step: int, cause: str) -> int:
        raise AssertionError(cause)


@pytest.mark.parametrize(("fresh", "processes"), [(False, 1), (True, 3)])
def test_a_task_gets_a_process_of_its_own_where_that_is_asked(fresh: bool, processes: int) -> None:
    found = list(run_parallel(ProcessIds(), range(3), 1, fresh=fresh))
    assert (len(found), len(set(found))) == (3, processes)
