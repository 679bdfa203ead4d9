"""A real log, disturbed: what it is to come through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.evaluation.trajectory import Trajectory, trajectory_error
from albot_core.logs.disturbed import disturbed
from albot_core.logs.reader import read_log
from albot_core.mappers.albot1.mapper import Albot1


# At the 93rd reading of Freiburg's log the views hardly agree under any turn: under false turns of
# seed 8 the odometer's own motion has to be tried, without an odometer more than eight motions.
@pytest.mark.parametrize(("disturbance", "seed"), [("noise", 0), ("odometer", 8), ("frozen", 0)])
def test_freiburg_is_mapped_however_it_is_disturbed(
    data: Path, disturbance: str, seed: int
) -> None:
    log = read_log(data / "logs" / "freiburg-101-corrected.log.gz")
    mapper, poses, readings = Albot1(), [], disturbed(log, disturbance, seed).readings
    for reading in readings:
        mapper.update(reading)
        poses.append(mapper.estimate.pose.copy())
    assert log.reference_trajectory is not None
    stamps = np.array([reading.stamp for reading in readings])
    believed = Trajectory(stamps=stamps, poses=np.array(poses))
    error = trajectory_error(believed, log.reference_trajectory)
    assert error is not None
    assert error.rmse < 0.3
