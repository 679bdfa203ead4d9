"""Time that Albot0 takes to split a long journey into regions."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from albot_benchmarks.mapper import tour_readings
from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.regions import RegionConfig, split_journey
from albot_core.mappers.albot0.steps import NO_STEPS, join_steps

_PATHS = 500
"""Number of robot paths of the journey that is split into regions."""


def measure_splitting(paths: int = _PATHS, rounds: int = 5) -> list[dict[str, float | int | str]]:
    """Time the region split and merge of `albot0`, which runs at every stop, on a long journey.

    The journey repeats the tour, each time shifted a little as by a drifting odometer.

    Returns:
        The mapper's `name`; the numbers of robot `paths` and of `regions`; and `split_ms`, the
        processor time of one split (ms, the least of `rounds`).
    """
    mapper = Albot0()
    for reading in tour_readings(has_sonars=True):
        mapper.update(reading)
    lap = mapper.geometric_maps[0].steps
    steps, lines = NO_STEPS, lap.lines.reshape(-1, 2, 2)
    while steps.begins.sum() < paths:
        moved = lines + 0.1 * np.array((1.0, -1.0)) * len(steps.lines) / len(lap.lines)
        steps = join_steps(steps, replace(lap, lines=moved.reshape(-1, 4)))
    last = np.flatnonzero(steps.begins)[paths] if steps.begins.sum() > paths else len(steps.lines)
    steps, ground, config = steps.part(slice(0, int(last))), Ground(), RegionConfig()
    ground.add(steps.swaths)
    took, regions, widths = np.inf, 0, steps.widths.sum(axis=1)
    for _ in range(rounds):
        started = time.process_time()
        regions = split_journey(steps.lines, widths, steps.begins, ground, config).count
        took = min(took, 1e3 * (time.process_time() - started))
    return [{"name": "albot0", "paths": paths, "regions": regions, "split_ms": took}]
