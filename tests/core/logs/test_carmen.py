"""Lines of CARMEN logs, each alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.logs.carmen import read
from albot_core.logs.text import LogText

ROBOTLASER = "ROBOTLASER1 0 {start} 2.0 {spacing} 20 0.01 0 3 1.0 2.0 3.0 0 {poses} 0 0 0 0 0 {end}"


@pytest.mark.parametrize(
    ("start", "spacing", "ranges"),
    [(-1.0, 0.9, (1.0, 2.0, 3.0)), (-1.0, 1e-3, (1.0, 2.0, 3.0)), (1.0, -0.9, (3.0, 2.0, 1.0))],
)
def test_ranges_come_from_the_right_to_the_left(
    start: float, spacing: float, ranges: tuple[float, ...]
) -> None:
    """They stand so in the line, unless the laser's spacing is negative."""
    line = ROBOTLASER.format(start=start, spacing=spacing, poses="0 0 0 " * 2, end="5.0 host 5.0")
    recording = read(LogText(Path("a.log"), f"{line}\n"), False)
    assert recording.scans[0].ranges.tolist() == list(ranges)
    assert recording.geometry.spacing == abs(spacing)
    assert (np.diff(recording.geometry.bearings) > 0).all()
