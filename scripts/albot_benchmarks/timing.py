"""Time workloads in turns, because timings are noisy; and describe the machine."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from importlib.metadata import version
from pathlib import Path

import numpy as np

Workload = Callable[[], int]
"""A function that does a piece of work and returns its number of steps."""


@dataclass(frozen=True, kw_only=True)
class Rate:
    """Steps per second."""

    wall_clock: float = 0.0
    """By wall-clock time."""
    cpu: float = 0.0
    """By the processor time of this process, summed over its threads. For one thread, it is the
    wall-clock rate on an otherwise idle machine."""

    def better(self, other: Rate) -> Rate:
        """Return the larger of both rates."""
        return Rate(
            wall_clock=max(self.wall_clock, other.wall_clock),
            cpu=max(self.cpu, other.cpu),
        )

    def __add__(self, other: Rate) -> Rate:
        """Return the summed rates of two processes."""
        return Rate(
            wall_clock=self.wall_clock + other.wall_clock,
            cpu=self.cpu + other.cpu,
        )


def best_rates(workloads: Mapping[str, Workload], rounds: int) -> dict[str, Rate]:
    """Return each workload's best rates over several rounds, in which each has one turn.

    Before the rounds each workload runs once, untimed, to compile its code.
    """
    for workload in workloads.values():
        workload()
    rates = rates_in_turns(workloads, rounds)
    return {name: reduce(Rate.better, each) for name, each in rates.items()}


def rates_in_turns(workloads: Mapping[str, Workload], rounds: int) -> dict[str, list[Rate]]:
    """Return each workload's rate in each of several rounds, in which each has one turn."""
    rates: dict[str, list[Rate]] = {name: [] for name in workloads}
    for _ in range(rounds):
        for name, workload in workloads.items():
            rates[name].append(rate_of(workload))
    return rates


def rate_of(workload: Workload, seconds: float = 0.0) -> Rate:
    """Return the rate of one turn, or of all turns that begin within `seconds` seconds."""
    clock, processor = time.perf_counter(), time.process_time()
    end, steps = clock + seconds, workload()
    while time.perf_counter() < end:
        steps += workload()
    clock, processor = time.perf_counter() - clock, time.process_time() - processor
    # The processor clock may be too coarse for a turn; then the wall clock is used.
    return Rate(wall_clock=steps / clock, cpu=steps / (processor or clock))


_LIBRARIES = ("numpy", "numba", "pymunk", "gymnasium")


def describe_machine() -> dict[str, str | int | dict[str, str] | None]:
    """Return processor, cores, system, Python, and the versions of the main libraries."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in _LIBRARIES},
    }


def calibrate(rounds: int = 5) -> dict[str, float]:
    """Time fixed work, so that figures of different machines can be compared.

    Returns:
        `python_ms`, for a loop of a million additions in Python, and `numpy_ms`, for the square
        roots of 4 million numbers in numpy; on one core, the best of `rounds` rounds.
    """
    numbers = np.arange(4e6)
    roots = np.empty_like(numbers)
    return {
        "python_ms": _best_ms(_add_up, rounds),
        "numpy_ms": _best_ms(lambda: np.sqrt(numbers, out=roots), rounds),
    }


def _add_up() -> int:
    total = 0
    for number in range(1_000_000):
        total += number
    return total


def _best_ms(work: Callable[[], object], rounds: int) -> float:
    best = np.inf
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - began)
    return 1e3 * float(best)


def _processor() -> str:
    """Return the processor's name, which `platform` does not know on Linux."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
