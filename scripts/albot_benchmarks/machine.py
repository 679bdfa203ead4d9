"""What the figures of a benchmark were measured on."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

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
