"""The processes' benchmark, in a hurry. No test of speed."""

from __future__ import annotations

import pytest

from albot_env.benchmarks.environment import Case
from albot_env.benchmarks.processes import measure_processes


def test_one_and_two_processes_are_timed() -> None:
    figures = measure_processes(Case(mapper="none", num_envs=2, steps=4), seconds=0.05, rounds=1)
    assert (figures["num_envs"], figures["processes"]) == (2, 2)
    single, together = float(figures["single"]), float(figures["together"])
    assert single > 0
    assert figures["scaling"] == pytest.approx(together / single)
    assert float(figures["scaling_cpu"]) > 0
