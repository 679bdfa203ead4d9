"""The cost of mappers, in costs of another that runs beside them."""

from __future__ import annotations

from albot_benchmarks.mapper import relative_cost, tour_readings


def test_odometry_costs_as_much_as_itself_and_scan_matching_more() -> None:
    readings = tour_readings()
    assert 0.4 < relative_cost("odometry", readings) < 2.5
    assert relative_cost("scan-matching", readings, 1) > 2.5
