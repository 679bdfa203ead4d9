"""Rates of several ways of doing a thing, measured in turns: machines are noisy."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

Lap = Callable[[], int]
"""Does a piece of work; how many steps it was."""


def best_rates(laps: Mapping[str, Lap], rounds: int) -> dict[str, float]:
    """Steps a second of each, the best of several rounds in which each has its turn.

    Before that each has one turn that is not timed, which compiles.
    """
    for lap in laps.values():
        lap()
    rates = dict.fromkeys(laps, 0.0)
    for _ in range(rounds):
        for name, lap in laps.items():
            rates[name] = max(rates[name], timed(lap))
    return rates


def timed(lap: Lap) -> float:
    """Steps a second of one turn."""
    started = time.perf_counter()
    steps = lap()
    return steps / (time.perf_counter() - started)
