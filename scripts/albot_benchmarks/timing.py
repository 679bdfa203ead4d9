"""Timing work in turns, because machines are noisy; and what machine it was timed on."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

Workload = Callable[[], int]
"""Does a piece of work and returns how many steps it was."""


@dataclass(frozen=True, kw_only=True)
class Rate:
    """How many steps a second."""

    wall_clock: float = 0.0
    """By the clock."""
    cpu: float = 0.0
    """By the time that processors worked for this process (all its threads in sum): what
    the clock would say of one thread if nothing else ran on the machine."""

    def better(self, other: Rate) -> Rate:
        """The greater of both rates."""
        return Rate(
            wall_clock=max(self.wall_clock, other.wall_clock),
            cpu=max(self.cpu, other.cpu),
        )

    def __add__(self, other: Rate) -> Rate:
        """The rates of two processes at once, in sum."""
        return Rate(
            wall_clock=self.wall_clock + other.wall_clock,
            cpu=self.cpu + other.cpu,
        )


def best_rates(workloads: Mapping[str, Workload], rounds: int) -> dict[str, Rate]:
    """The rates of each, the best of several rounds in which each has its turn.

    Before that each has one turn that is not timed, which compiles.
    """
    for workload in workloads.values():
        workload()
    rates = dict.fromkeys(workloads, Rate())
    for _ in range(rounds):
        for name, workload in workloads.items():
            rates[name] = rates[name].better(rate_of(workload))
    return rates


def rate_of(workload: Workload, seconds: float = 0.0) -> Rate:
    """The rate of one turn, or of as many as begin within some seconds."""
    clock, processor = time.perf_counter(), time.process_time()
    end, steps = clock + seconds, workload()
    while time.perf_counter() < end:
        steps += workload()
    clock, processor = time.perf_counter() - clock, time.process_time() - processor
    # The processor's clock may tick too slowly for a turn; then the other's must do.
    return Rate(wall_clock=steps / clock, cpu=steps / (processor or clock))


_LIBRARIES = ("numpy", "numba", "pymunk", "gymnasium")


def describe_machine() -> dict[str, str | int | dict[str, str] | None]:
    """Processor, cores, system, Python, and the versions of the libraries that matter."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in _LIBRARIES},
    }


def calibrate(rounds: int = 5) -> dict[str, float]:
    """How long work takes that never changes, to hold figures of other machines against.

    Returns:
        `python_ms`, for a loop of a million additions in Python, and `numpy_ms`, for the
        square roots of 4 million numbers in numpy: one core, the best of some rounds.
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
    """The processor's name, which `platform` does not know on Linux."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
