"""Spin time of torch's threads, which otherwise take processors from the environments."""

from __future__ import annotations

import os

SPINS = 10_000
"""Number of spins of a waiting thread, some tenths of a millisecond in all."""


def spin_briefly() -> None:
    """Make torch's idle threads sleep soon. Call it before torch is imported.

    By default GNU's OpenMP lets them spin some 300,000 times after each pass through a network.
    That is longer than a batch of environments takes to step, which then has one processor fewer
    (https://gcc.gnu.org/onlinedocs/libgomp/GOMP_005fSPINCOUNT.html). Threads that sleep at once
    would wake up too late between two small passes. A `GOMP_SPINCOUNT` set by the user is kept.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", str(SPINS))
