"""The command log: the wheel speeds that each robot was to reach, step by step.

Chipmunk keeps contacts, impulses and a tree of bounding boxes that cannot be read or written. But a
robot's motion is a function of how it was placed and of its commands since then, to the bit. So the
log stands for that hidden state: replayed from the same placement, it leads to it again.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from jaxtyping import Float64, Int64

Targets = Float64[np.ndarray, "steps 2"]
"""Target speeds of the left and right wheels, one row per control step (m/s)."""

NO_TARGETS: Targets = np.zeros((0, 2))
BLOCK = 256
"""Number of control steps in a block of the log. Blocks that no robot needs any more are dropped,
so that the log is as long as the longest episode under way: 16 bytes per robot and step."""


class CommandLog:
    """The commands of the robots of a batch since each was placed.

    Args:
        robots: Number of robots.
        block: Number of control steps in a block.
    """

    def __init__(self, robots: int, block: int = BLOCK) -> None:
        self._robots = robots
        self._block = block
        self._before = [NO_TARGETS] * robots
        self._since: Int64[np.ndarray, "robots"] = np.zeros(robots, np.int64)
        self._blocks: deque[Float64[np.ndarray, "block robots 2"]] = deque()
        self._first = self._now = 0

    def restart(self, row: int, targets: Targets = NO_TARGETS) -> None:
        """Forget a robot's commands; it has followed `targets` since it was placed."""
        self._before[row] = targets
        self._since[row] = self._now

    def append(self, targets: Float64[np.ndarray, "robots 2"]) -> None:
        """Add the commands of one control step of all robots."""
        if self._now == self._first + self._block * len(self._blocks):
            oldest = int(self._since.min())
            while self._blocks and self._first + self._block <= oldest:
                self._blocks.popleft()
                self._first += self._block
            if not self._blocks:
                self._first = self._now
            self._blocks.append(np.empty((self._block, self._robots, 2)))
        self._blocks[-1][self._now - self._first - self._block * (len(self._blocks) - 1)] = targets
        self._now += 1

    def of(self, row: int) -> Targets:
        """Return the commands of a robot since it was placed (a copy)."""
        begin, end = int(self._since[row]) - self._first, self._now - self._first
        parts = [self._before[row]]
        for k, block in enumerate(self._blocks):
            parts.append(
                block[max(0, begin - self._block * k) : max(0, end - self._block * k), row]
            )
        return np.concatenate(parts)
