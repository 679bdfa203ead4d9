"""What tells that the poses of scans are corrected ones."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.logs.corrected import OdometerLine, Sweep, recover_odometry


@pytest.mark.parametrize(
    ("clock", "after", "corrected"),
    [
        (100.0, 0.0, True),
        (100.0, None, False),  # The odometer's own line, of the scan's moment.
        (0.0, 0.0, False),  # A log without a clock: all its stamps are 0.
    ],
)
def test_a_pose_repeated_with_the_stamp_0_is_a_corrected_one(
    clock: float, after: float | None, corrected: bool
) -> None:
    records: list[OdometerLine | Sweep] = []
    for k in range(4):
        pose, stamp = np.array((float(k), 0.0, 0.0)), clock and clock + k
        records += [
            Sweep(stamp=stamp, ranges=np.ones(180), laser=pose, robot=pose),
            OdometerLine(stamp=stamp if after is None else after, pose=pose),
        ]
    assert (recover_odometry(records) is not None) == corrected
