"""Tasks in parallel processes: what those hear."""

from __future__ import annotations

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
        out, told = process.communicate(timeout=60)
    blocked = sorted(number.name for number in INTERRUPTS)
    assert (told, out.decode().strip()) == (b"", str([blocked] * 3))


def test_signals_reach_us_again_once_workers_are_started() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    list(run_parallel(BlockedSignals(), range(2), 2))
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
