"""Random worlds generated per second, including their validation."""

from __future__ import annotations

import time

from albot_maps import load_world
from albot_maps.generators.spec import KINDS


def measure_generators(worlds: int = 50, rounds: int = 5) -> list[dict[str, float | str]]:
    """Time every kind of random world with its default parameters (an office has 20 rooms).

    Args:
        worlds: Number of worlds per round, with one seed each.
        rounds: Number of rounds; the best counts.

    Returns:
        One row per kind: `kind`, `walls` (mean number) and `worlds_per_second` on one core.
    """
    rows: list[dict[str, float | str]] = []
    for kind in KINDS:
        walls = sum(len(load_world(f"random:{kind}:{seed}").walls) for seed in range(worlds))
        best = 0.0
        for _ in range(rounds):
            started = time.perf_counter()
            for seed in range(worlds):
                load_world(f"random:{kind}:{seed}")
            best = max(best, worlds / (time.perf_counter() - started))
        rows.append({"kind": kind, "walls": walls / worlds, "worlds_per_second": best})
    return rows
