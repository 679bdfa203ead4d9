"""Trajectories as evo reads and judges them."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from evo.core import metrics
from evo.tools import file_interface

from albot_core.evaluation.trajectory import Trajectory, trajectory_error
from albot_core.export.kitti import write_kitti
from albot_core.export.tum import write_tum


def _wander(seed: int) -> Trajectory:
    """Forty poses on a way with turns."""
    rng = np.random.default_rng(seed)
    headings = rng.normal(0, 0.3, 40).cumsum()
    steps = np.column_stack((np.cos(headings), np.sin(headings)))
    return Trajectory(
        stamps=1000.0 + np.arange(40.0), poses=np.column_stack((steps.cumsum(axis=0), headings))
    )


def test_evo_reads_the_poses_that_were_written(tmp_path):
    ours = _wander(1)
    write_tum(ours, tmp_path / "a.tum")
    write_kitti(ours, tmp_path / "a.kitti")
    tum = file_interface.read_tum_trajectory_file(tmp_path / "a.tum")
    assert np.allclose(tum.timestamps, ours.stamps, atol=1e-6)
    for read in (tum, file_interface.read_kitti_poses_file(tmp_path / "a.kitti")):
        assert np.allclose(read.positions_xyz[:, :2], ours.poses[:, :2], atol=1e-6)
        turned = [np.arctan2(pose[1, 0], pose[0, 0]) for pose in read.poses_se3]
        assert np.allclose(np.sin(turned - ours.poses[:, 2]), 0, atol=1e-5)
        assert np.allclose(np.cos(turned - ours.poses[:, 2]), 1, atol=1e-5)


def test_evo_finds_the_same_absolute_error(tmp_path):
    truth, guess = _wander(1), _wander(1)
    guess.poses[:, :2] += np.random.default_rng(2).normal(0, 0.1, (40, 2))
    read = []
    for name, trajectory in (("truth", truth), ("guess", guess)):
        write_tum(trajectory, tmp_path / name)
        read.append(file_interface.read_tum_trajectory_file(tmp_path / name))
    aligned = deepcopy(read[1])
    aligned.align(read[0])
    theirs = metrics.APE(metrics.PoseRelation.translation_part)
    theirs.process_data((read[0], aligned))
    ours = trajectory_error(guess, truth)
    assert ours is not None
    assert ours.rmse == pytest.approx(theirs.get_statistic(metrics.StatisticsType.rmse), abs=1e-6)
