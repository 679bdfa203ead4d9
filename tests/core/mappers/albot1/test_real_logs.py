"""A real log, disturbed: what it is to come through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.evaluation.trajectory import Trajectory, trajectory_error
from albot_core.logs.disturbed import disturbed
from albot_core.logs.reader import read_log
from albot_core.mappers.albot1.mapper import Albot1


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
    mapper, poses, readings = Albot1(), [], disturbed(log, disturbance, seed).readings
    for reading in readings:
        mapper.update(reading)
        poses.append(mapper.estimate.pose.copy())
    assert log.reference_trajectory is not None
    stamps = np.array([reading.stamp for reading in readings])
    believed = Trajectory(stamps=stamps, poses=np.array(poses))
    error = trajectory_error(believed, log.reference_trajectory)
    assert error is not None
    assert error.rmse < most
