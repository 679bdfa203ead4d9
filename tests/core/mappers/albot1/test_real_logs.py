"""A real log, disturbed: what it is to come through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.evaluation.trajectory import Trajectory, path_length, trajectory_error
from albot_core.geometry.types import Poses
from albot_core.logs.disturbed import disturbed
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log
from albot_core.mappers.albot1.mapper import Albot1


def mapped(log: Log) -> Poses:
    """Where the robot believes to be at each reading (m, rad)."""
    mapper, poses = Albot1(), []
    for reading in log.readings:
        mapper.update(reading)
        poses.append(mapper.estimate.pose.copy())
    return np.array(poses)


# At some readings of these logs views hardly agree under the right turn. There the odometer's own
# motion has to be tried, no motion twice, and without an odometer more than eight.
@pytest.mark.parametrize(
    ("file", "disturbance", "seed", "most"),
    [
        ("freiburg-101-corrected.log.gz", "noise", 0, 0.3),
        ("freiburg-101-corrected.log.gz", "odometer", 8, 0.3),
        ("freiburg-101-corrected.log.gz", "frozen", 0, 0.3),
        ("aces-corrected.log.gz", "odometer", 8, 3.0),
    ],
)
def test_logs_are_mapped_however_they_are_disturbed(
    data: Path, file: str, disturbance: str, seed: int, most: float
) -> None:
    log = read_log(data / "logs" / file)
    worse = disturbed(log, disturbance, seed)
    believed = Trajectory(stamps=worse.stamps, poses=mapped(worse))
    assert log.reference_trajectory is not None
    error = trajectory_error(believed, log.reference_trajectory)
    assert error is not None
    assert error.rmse < most


@pytest.mark.parametrize("seed", [0, 1])
def test_a_robot_without_odometer_is_not_carried_along_a_bare_corridor(
    data: Path, seed: int
) -> None:
    # Walls on both sides of an alcove there, drawn as one, carried it along by some 10 m.
    log = read_log(data / "logs" / "duke_loop5.log.xz")
    way = path_length(mapped(disturbed(log, "frozen", seed)))
    assert way == pytest.approx(path_length(log.odometry), rel=0.05)
