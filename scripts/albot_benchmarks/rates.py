"""Rates of several ways of doing a thing, measured in turns: machines are noisy."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Lap = Callable[[], int]
"""Does a piece of work; how many steps it was."""


@dataclass(frozen=True, kw_only=True)
class Rate:
    """How many steps a second."""

    by_clock: float = 0.0
    """By the clock on the wall."""
    by_processor: float = 0.0
    """By the time that processors worked for this process (all its threads in sum): what
    the clock would say of one thread if nothing else ran on the machine."""

    def better(self, other: Rate) -> Rate:
        """The greater of both rates."""
        return Rate(
            by_clock=max(self.by_clock, other.by_clock),
            by_processor=max(self.by_processor, other.by_processor),
        )

    def __add__(self, other: Rate) -> Rate:
        """The rates of two processes at once, in sum."""
        return Rate(
            by_clock=self.by_clock + other.by_clock,
            by_processor=self.by_processor + other.by_processor,
        )


def best_rates(laps: Mapping[str, Lap], rounds: int) -> dict[str, Rate]:
    """The rates of each, the best of several rounds in which each has its turn.

    Before that each has one turn that is not timed, which compiles.
    """
    for lap in laps.values():
        lap()
    rates = dict.fromkeys(laps, Rate())
    for _ in range(rounds):
        for name, lap in laps.items():
            rates[name] = rates[name].better(rate_of(lap))
    return rates


def rate_of(lap: Lap, seconds: float = 0.0) -> Rate:
    """The rate of one turn, or of as many as begin within some seconds."""
    clock, processor = time.perf_counter(), time.process_time()
    end, steps = clock + seconds, lap()
    while time.perf_counter() < end:
        steps += lap()
    clock, processor = time.perf_counter() - clock, time.process_time() - processor
    # The processor's clock may tick too slowly for a turn; then the other's must do.
    return Rate(by_clock=steps / clock, by_processor=steps / (processor or clock))
