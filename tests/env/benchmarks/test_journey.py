from __future__ import annotations

from types import SimpleNamespace

import numpy as np

import albot_env.benchmarks.mapper as benchmark
from albot_cli.bench_report import _journey
from albot_core.geometry.poses import relative
from albot_core.perception.reading import Reading
from tests.core.scenes import FURNITURE, house_walk, scan_from, two_rooms


def test_a_journey_is_told_stage_by_stage(monkeypatch):
    path, house = house_walk(), np.concatenate((two_rooms(), FURNITURE))
    motions = relative(path[np.maximum(np.arange(len(path)) - 1, 0)], path)
    readings = [
        Reading(stamp=float(k), motion=motions[k], laser=scan_from(pose, house))
        for k, pose in enumerate(path)
    ]
    tour = SimpleNamespace(truth=path, readings=readings)
    monkeypatch.setattr(benchmark, "_tour", lambda: tour)
    row, last = benchmark.measure_journey(2, 0.05)
    assert (row["path_km"], last["path_km"]) == (0.05, 0.1)
    assert float(row["us_per_reading"]) > 0
    # To and fro between two rooms: nothing is added to what is known.
    assert (row["places"], last["places"]) == (2, 2)
    assert 10 < int(last["surfaces"]) < 60
    assert 1_000 < int(last["memory_bytes"]) < 100_000
    assert _journey(last).startswith("journey         0.1 km")
