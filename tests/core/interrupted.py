"""A program that is interrupted again and again while compiled code makes arrays."""

from __future__ import annotations

import math
import signal
from typing import Any

import numpy as np

from albot_core.kernels.compiled import kernel

ROUNDS = 10


class StoppedError(Exception):
    """What Ctrl-C raises in other programs."""


@kernel(arrays=True)
def _work(rounds: int) -> tuple[np.ndarray, int]:
    found = np.zeros(2)
    for k in range(rounds):
        found[k % 2] += math.sin(k)
    return found, rounds


def _stop(*_: Any) -> None:
    raise StoppedError


def main() -> None:
    """Print how often it was stopped as it should be."""
    _work(1)
    signal.signal(signal.SIGALRM, _stop)
    stopped = 0
    for _ in range(ROUNDS):
        signal.setitimer(signal.ITIMER_REAL, 0.01)
        try:
            _work(10_000_000)
        except StoppedError:
            stopped += 1
    print(stopped)


if __name__ == "__main__":
    main()
