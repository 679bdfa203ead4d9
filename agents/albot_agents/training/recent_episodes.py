"""Success rate and mean return of recent episodes, without a bias towards those that end early."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

RECENT = 500
"""Number of episodes over which success rate and mean return are computed."""
ENOUGH = 100
"""Smallest number of episodes of which they are shown: with fewer, chance could still move the
success rate by more than 0.1 (twice its standard error, √(0.25 / 100))."""


class EndedEpisode(NamedTuple):
    """An episode that has ended."""

    row: int
    """Its environment."""
    total_return: float
    """The sum of its rewards."""
    is_success: bool | None
    """Whether it succeeded; None in a task that cannot succeed."""


class RecentEpisodes:
    """The last `RECENT` episodes, in the order in which they began, not in which they ended.

    When all environments begin anew, as after `--resume`, short episodes end first, and say nothing
    about the others. An episode is therefore counted once all that began before it have ended. So
    the counted ones are the first of all, however long each of them lasts.

    Args:
        environments: Number of environments, all of which begin an episode now.
    """

    def __init__(self, environments: int) -> None:
        self._step = 0
        self._began = np.zeros(environments, np.int64)  # Step at which each row's episode began.
        self._waiting: list[tuple[int, EndedEpisode]] = []  # A heap; of equal steps by row.
        self._returns: deque[float] = deque(maxlen=RECENT)
        self._successes: deque[bool] = deque(maxlen=RECENT)

    def step(self, ended: Iterable[EndedEpisode]) -> None:
        """Take a step of all environments, in which some episodes ended and others began."""
        self._step += 1
        for episode in ended:
            heapq.heappush(self._waiting, (int(self._began[episode.row]), episode))
            self._began[episode.row] = self._step
        row = int(np.argmin(self._began))  # The first of equals.
        running = int(self._began[row]), row
        while self._waiting and (self._waiting[0][0], self._waiting[0][1].row) < running:
            _, episode = heapq.heappop(self._waiting)
            self._returns.append(episode.total_return)
            if episode.is_success is not None:
                self._successes.append(episode.is_success)

    @property
    def success_rate(self) -> float | None:
        """Their success rate; None with fewer than `ENOUGH`, or if the task cannot succeed."""
        return _mean(self._successes)

    @property
    def mean_return(self) -> float | None:
        """Their mean return; None with fewer than `ENOUGH`."""
        return _mean(self._returns)


def _mean(values: deque[float] | deque[bool]) -> float | None:
    return float(np.mean(values)) if len(values) >= ENOUGH else None
