"""The benchmark of the generators names every kind and times it. No test of speed."""

from __future__ import annotations

from albot_benchmarks.generator import measure_generators
from albot_maps.generators.spec import KINDS


def test_every_kind_is_timed():
    rows = measure_generators(worlds=1, rounds=1)
    assert [row["kind"] for row in rows] == list(KINDS)
    assert all(float(row["worlds_per_second"]) > 0 and float(row["walls"]) > 4 for row in rows)
