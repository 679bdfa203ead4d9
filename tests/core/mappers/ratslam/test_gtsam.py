"""The relaxed experience map beside GTSAM's optimum of the same graph."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.mappers.ratslam.config import CorrectionConfig, RatSlamConfig
from albot_core.mappers.ratslam.mapper import RatSlam
from tests.core.mappers.ratslam.lap import lead, true_laps

gtsam = pytest.importorskip("gtsam")

BIAS = math.radians(1.0)
"""The odometer's (rad/s): a lap of 44 s is 44° too much."""


def optimum(mapper: RatSlam) -> np.ndarray:
    """Where GTSAM puts the experiences, beginning from where they are."""
    experiences, links = mapper.experiences, mapper.experiences.links
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for number, pose in enumerate(experiences.poses):
        values.insert(number, gtsam.Pose2(*pose))
    anchor = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*experiences.poses[0]), anchor))
    for source, target, motion, stiffness in zip(
        *(links.rows(name) for name in ("source", "target", "motion", "stiffness")), strict=True
    ):
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1 / math.sqrt(stiffness)))
        between = gtsam.Pose2(*motion)
        graph.add(gtsam.BetweenFactorPose2(int(source), int(target), between, noise))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = [result.atPose2(number) for number in range(experiences.count)]
    return np.array([(pose.x(), pose.y()) for pose in poses])


def test_the_relaxed_map_is_gtsams_optimum_but_for_a_twentieth_of_its_size():
    mapper = RatSlam(RatSlamConfig.scenes(), "ratslam-scenes")
    lead(mapper, true_laps(5), BIAS)
    for _ in range(500):
        mapper.experiences.correct()
    points = mapper.experiences.poses[:, :2]
    size = float(np.ptp(points, axis=0).max())
    off = np.hypot(*(points - optimum(mapper)).T)
    assert mapper.experiences.links.count > mapper.experiences.count  # Loops are closed.
    assert off.max() < 0.05 * size


def test_without_correction_it_is_not():
    config = RatSlamConfig(
        sees="scenes",
        views=RatSlamConfig.scenes().views,
        correction=CorrectionConfig(passes=0),
    )
    mapper = RatSlam(config, "ratslam-scenes")
    lead(mapper, true_laps(5), BIAS)
    points = mapper.experiences.poses[:, :2]
    off = np.hypot(*(points - optimum(mapper)).T)
    assert off.max() > 0.2 * float(np.ptp(points, axis=0).max())
