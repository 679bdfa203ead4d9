"""How long torch's threads spin before they sleep, where environments want the processors too."""

from __future__ import annotations

import os

SPINS = 10_000
"""Turns of a thread that waits for work, some tenths of a millisecond in all."""


def spin_briefly() -> None:
    """Let torch's threads go to sleep soon after they have nothing to do: before it is imported.

    As it comes, GNU's OpenMP lets them spin for some 300,000 turns after each pass through a
    network, longer than a batch of environments takes to step, which then has one processor
    fewer (https://gcc.gnu.org/onlinedocs/libgomp/GOMP_005fSPINCOUNT.html). Asleep at once they
    would wake up too late between two small passes. Who has set `GOMP_SPINCOUNT` keeps it.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", str(SPINS))
