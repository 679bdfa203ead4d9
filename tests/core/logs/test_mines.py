"""Logs of BreezySLAM: wheels' ticks and ranges without a keyword."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.logs.reader import read_log

TURN = 2 * np.pi * 0.077
"""Way of a wheel in a turn (m), of 2,000 ticks."""
WALL = 1.5


def scan_line(seconds: float, left: int, right: int, *, head: int = 25) -> str:
    """A scan of a straight wall to the robot's left, 1.5 m from the line that it drives along."""
    bearings = (np.arange(682) - 340) * 2 * np.pi / 1024
    with np.errstate(divide="ignore"):
        ranges = np.where(bearings > 0.01, WALL / np.sin(bearings), 0.0)
    beams = " ".join(f"{1000 * value:.0f}" if 0 < value < 5.5 else "7" for value in ranges)
    return f"{1e6 * seconds:.0f} 14554 {left} {right} {'0 ' * (head - 4)} {beams} "


def write_log(path, counters, **options):
    lines = [scan_line(30 + 0.1 * k, *each, **options) for k, each in enumerate(counters)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("head", [24, 25])
def test_the_wheels_tell_the_way(head, tmp_path):
    # A turn straight ahead; a quarter turn to the left on the spot; half a circle of 0.33 m radius.
    quarter = round(0.165 * np.pi / 2 / TURN * 2000)
    inner, outer = (round(np.pi * radius / TURN * 2000) for radius in (0.165, 0.495))
    counters = np.cumsum([(14000, 9000), (2000, 2000), (-quarter, quarter), (inner, outer)], axis=0)
    log = read_log(write_log(tmp_path / "exp.dat", counters.tolist(), head=head))
    np.testing.assert_allclose(log.stamps, [30, 30.1, 30.2, 30.3])
    motions = relative(log.odometry[:-1], log.odometry[1:])
    np.testing.assert_allclose(motions[0], (TURN, 0, 0), atol=1e-9)
    np.testing.assert_allclose(motions[1], (0, 0, np.pi / 2), atol=0.002)
    np.testing.assert_allclose(motions[2][:2], (0, 0.66), atol=0.002)
    assert np.abs(motions[2][2]) == pytest.approx(np.pi, abs=0.003)


def test_the_laser_sees_a_wall_where_it_is(tmp_path):
    log = read_log(write_log(tmp_path / "exp.dat", [(0, 0), (10, 10)]))
    assert (log.geometry.beams, log.geometry.mount) == (542, (0.145, 0, 0))
    seen = log.ranges[0] < np.inf
    points = log.ranges[0][seen, None] * log.geometry.directions[seen]
    assert seen.sum() > 200
    np.testing.assert_allclose(points[:, 1], WALL, atol=0.002)
    assert not seen[log.geometry.bearings < 0].any()


def test_a_damaged_line_is_named(tmp_path):
    path = write_log(tmp_path / "exp.dat", [(0, 0), (10, 10), (20, 20)])
    lines = path.read_text().split("\n")
    lines[1] = lines[1][:-100]
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="line 2: expected 24 or 25 numbers and 682"):
        read_log(path)
    log = read_log(path, keep_going=True)
    assert len(log.stamps) == 2
    assert (log.unread.lines, log.unread.scans, log.unread.where) == (1, 1, "line 2")
