"""How fast the systems of metric SLAM are, beside OpenKarto in the same run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from albot_benchmarks.mapper import tour_readings
from albot_benchmarks.timing import best_rates
from albot_core.mappers.registry import installed_mappers, make_mapper
from albot_core.sensing.reading import Reading

YARDSTICK = "karto"
SYSTEMS = ("scan-matching", "graph-slam", "gmapping", "grid-slam", "dp-slam", YARDSTICK)


def measure_slam(
    readings: Sequence[Reading] | None = None, rounds: int = 3
) -> list[dict[str, float | str | None]]:
    """Time the systems that are installed on a run of readings, in turns.

    Args:
        readings: The readings; by default those of a simulated tour of `office-ring`.
        rounds: How many turns each has; the best counts.

    Returns:
        For each its `name`; `readings_per_second`; the same by the time that a processor works for
        it, `readings_per_cpu_second`; and how many times that is what the yardstick does in the
        same run, `ratio_to_karto`, None where that is not installed.
    """
    sensed = tour_readings() if readings is None else readings
    names = [name for name in SYSTEMS if name in installed_mappers()]
    rates = best_rates({name: _turn(name, sensed) for name in names}, rounds)
    yardstick = rates.get(YARDSTICK)
    return [
        {
            "name": name,
            "readings_per_second": rate.wall_clock,
            "readings_per_cpu_second": rate.cpu,
            "ratio_to_karto": None if yardstick is None else rate.cpu / yardstick.cpu,
        }
        for name, rate in rates.items()
    ]


def _turn(name: str, readings: Sequence[Reading]) -> Callable[[], int]:
    """Leads a fresh mapper through all readings."""

    def turn() -> int:
        mapper = make_mapper(name, rng=np.random.default_rng(0))
        for reading in readings:
            mapper.update(reading)
        return len(readings)

    return turn
