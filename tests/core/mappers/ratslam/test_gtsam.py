"""The relaxed experience map beside GTSAM's optimum of the same graph."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from albot_core.export.g2o import write_g2o
from albot_core.mappers.ratslam.config import CorrectionConfig, RatSlamConfig
from albot_core.mappers.ratslam.mapper import RatSlam
from tests.core.mappers.ratslam.lap import lead, true_laps

gtsam = pytest.importorskip("gtsam")

BIAS = math.radians(1.0)
"""The odometer's (rad/s): a lap of 44 s is 44° too much."""


def optimum(mapper: RatSlam, folder: Path) -> np.ndarray:
    """Where GTSAM puts the experiences of the exported graph, beginning from where they are.

    Files wrap headings, so a lap's bias must be less than half a turn.
    """
    write_g2o(mapper.snapshot().place_graph, folder / "network.g2o")
    graph, values = gtsam.readG2o(str(folder / "network.g2o"), False)
    assert graph.size() == mapper.experiences.links.count
    anchor = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))
    graph.add(gtsam.PriorFactorPose2(0, values.atPose2(0), anchor))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = [result.atPose2(number) for number in range(mapper.experiences.count)]
    return np.array([(pose.x(), pose.y()) for pose in poses])


def test_the_relaxed_map_is_gtsams_optimum_but_for_a_twentieth_of_its_size(tmp_path: Path):
    mapper = RatSlam(RatSlamConfig.scenes(), "ratslam-scenes")
    lead(mapper, true_laps(5), BIAS)
    for _ in range(500):
        mapper.experiences.correct()
    points = mapper.experiences.poses[:, :2]
    size = float(np.ptp(points, axis=0).max())
    off = np.hypot(*(points - optimum(mapper, tmp_path)).T)
    assert mapper.experiences.links.count > mapper.experiences.count  # Loops are closed.
    assert off.max() < 0.05 * size


def test_without_correction_it_is_not(tmp_path: Path):
    config = replace(RatSlamConfig.scenes(), correction=CorrectionConfig(passes=0))
    mapper = RatSlam(config, "ratslam-scenes")
    lead(mapper, true_laps(5), BIAS)
    points = mapper.experiences.poses[:, :2]
    off = np.hypot(*(points - optimum(mapper, tmp_path)).T)
    assert off.max() > 0.2 * float(np.ptp(points, axis=0).max())
