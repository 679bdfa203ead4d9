"""Real logs: odometers are disturbed as told, and Freiburg's is bettered."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from albot_core.evaluation.trajectory import path_length
from albot_experiments import ratslam_real
from albot_experiments.real_logs import LOGS, read_real_log

FREIBURG = LOGS[2]


def test_a_disturbed_odometer_measures_ways_too_long_or_too_short(data: Path) -> None:
    log = read_real_log(FREIBURG).log
    ratios = []
    for seed in range(5):
        other = ratslam_real.disturbed(log, np.random.default_rng(seed))
        ratios.append(path_length(other.odometry) / path_length(log.odometry))
        assert np.array_equal(other.ranges, log.ranges)
    assert max(abs(ratio - 1) for ratio in ratios) <= ratslam_real.SCALE
    assert np.ptp(ratios) > 0.01


def test_the_map_of_freiburg_is_better_than_its_odometer(data: Path) -> None:
    known = read_real_log(FREIBURG)
    run = ratslam_real.map_log(FREIBURG, known, [(0.5, 9.0)])
    assert run.error is not None and run.odometer_error is not None
    assert run.error < 0.5 * run.odometer_error
    assert run.wall_error < run.odometer_wall_error
    assert run.disturbed == (0.5,)
    assert len(run.graph.edges) > len(run.graph.nodes)
