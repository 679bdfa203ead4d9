"""Poses in KITTI's format: the matrices take points of the robot's frame to the trajectory's."""

from __future__ import annotations

import numpy as np

from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.kitti import write_kitti
from albot_core.geometry.poses import transform_points


def test_a_matrix_moves_points_as_its_pose_does(tmp_path):
    poses = np.array(((0, 0, 0), (1 / 3, -2, 0.5), (4, 5, -3)), float)
    write_kitti(Trajectory(stamps=np.arange(3.0), poses=poses), tmp_path / "a.kitti")
    matrices = np.loadtxt(tmp_path / "a.kitti").reshape(-1, 3, 4)
    assert np.array_equal(matrices[:, :2, 3], poses[:, :2])
    points = np.array(((1, 0), (0.5, -2), (0, 0)), float)
    for matrix, pose in zip(matrices, poses, strict=True):
        in_space = np.column_stack((points, np.full(3, 0.7), np.ones(3)))
        moved = in_space @ matrix.T
        np.testing.assert_allclose(moved[:, :2], transform_points(pose, points), atol=1e-15)
        assert (moved[:, 2] == 0.7).all()
        np.testing.assert_allclose(matrix[:, :3] @ matrix[:, :3].T, np.eye(3), atol=1e-15)
    assert "-0.0" not in (tmp_path / "a.kitti").read_text().splitlines()[0]
