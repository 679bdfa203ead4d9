"""The laser's errors: their size, their rate, and what they never touch."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from albot_benchmarks.laser import measure_laser
from albot_core.errors import InputError
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import LaserConfig
from albot_env.sim.noise import normal_table
from albot_env.sim.sensing import add_range_errors

GEOMETRY = LaserGeometry(beams=20_000, spacing=1e-4, max_range=30.0)


def sensed(true_range: float, place: int = 0, **errors: float) -> np.ndarray:
    config = LaserConfig(geometry=GEOMETRY, **errors)
    ranges = np.full(20_000, true_range)
    add_range_errors(
        ranges,
        np.uint64(1),
        place,
        normal_table(config.range_noise),
        config.dropout_threshold,
        GEOMETRY.max_range,
        np.empty(20_000, np.uint64),
    )
    return ranges


def test_ranges_scatter_by_the_noise_about_the_truth() -> None:
    ranges = sensed(5.0, range_noise=0.01, dropout=0.0)
    assert ranges.mean() == pytest.approx(5.0, abs=5e-4)
    assert ranges.std() == pytest.approx(0.01, rel=0.05)


def test_the_errors_are_normal_and_no_two_readings_share_them() -> None:
    one, other = (sensed(5.0, k * 20_000, range_noise=0.01, dropout=0.0) for k in range(2))
    assert kstest((one - 5.0) / 0.01, "norm").pvalue > 0.01
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.03
    assert abs(np.corrcoef(one[1:], one[:-1])[0, 1]) < 0.03


def test_beams_drop_out_at_the_rate_asked_for() -> None:
    ranges = sensed(5.0, range_noise=0.0, dropout=0.03)
    assert np.isinf(ranges).mean() == pytest.approx(0.03, rel=0.15)
    assert (ranges[np.isfinite(ranges)] == 5.0).all()


def test_noise_makes_no_range_negative_and_none_longer_than_the_reach() -> None:
    near = sensed(0.001, range_noise=0.01, dropout=0.0)
    assert near.min() == 0.0
    far = sensed(29.995, range_noise=0.01, dropout=0.0)
    assert far[np.isfinite(far)].max() < 30.0
    assert np.isinf(far).any()


def test_where_nothing_is_nothing_is_sensed() -> None:
    assert np.isinf(sensed(np.inf, range_noise=0.01, dropout=0.01)).all()


@pytest.mark.parametrize(
    ("field", "value"), [("range_noise", -1.0), ("range_noise", np.nan), ("dropout", 1.5)]
)
def test_impossible_errors_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"LaserConfig.{field}: expected"):
        LaserConfig(**{field: value})


def test_the_benchmark_measures_three_sizes() -> None:
    rows = measure_laser(0.05)
    assert [row["segments"] for row in rows] == [60, 200, 1000]
    for row in rows:
        assert row["ratio_to_pymunk"] == row["us_per_scan_pymunk"] / row["us_per_scan"]
        assert min(row.values()) > 0
