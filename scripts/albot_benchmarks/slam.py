"""Speed of the systems of metric SLAM, beside OpenKarto in the same run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from albot_benchmarks.mapper import tour_readings
from albot_benchmarks.timing import best_rates
from albot_core.mappers.registry import installed_mappers, make_mapper
from albot_core.sensing.reading import Reading

YARDSTICK = "karto"
SYSTEMS = ("scan-matching", "graph-slam", "gmapping", "grid-slam", "fastslam", "dp-slam", YARDSTICK)


def measure_slam(
    readings: Sequence[Reading] | None = None, rounds: int = 3
) -> list[dict[str, float | str | None]]:
    """Time the installed systems on a sequence of readings, in turns.

    Args:
        readings: The readings; by default those of a simulated tour of `office-ring`.
        rounds: Number of turns of each system; the best counts.

    Returns:
        One row per system: `name`; `readings_per_second`; `readings_per_cpu_second`, the same by
        processor time; and `ratio_to_karto`, the latter over the yardstick's in the same run, None
        if the yardstick is not installed.
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
    """Return a workload in which a new mapper processes all readings."""

    def turn() -> int:
        mapper = make_mapper(name, rng=np.random.default_rng(0))
        for reading in readings:
            mapper.update(reading)
        return len(readings)

    return turn
