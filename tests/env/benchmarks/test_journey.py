from __future__ import annotations

from albot_cli.bench_report import _journey
from albot_env.benchmarks.mapper import measure_journey


def test_a_journey_is_told_stage_by_stage():
    row, last = measure_journey(2, 0.1)
    assert (row["path_km"], last["path_km"]) == (0.1, 0.2)
    assert float(row["us_per_reading"]) > 0
    assert 50 < int(row["surfaces"]) < 400
    # Round and round a ring of six rooms: no places are added for those that are known.
    assert (row["places"], last["places"]) == (6, 6)
    assert 10_000 < int(row["memory_bytes"]) < 1_000_000
    assert _journey(row).startswith("journey         0.1 km")
