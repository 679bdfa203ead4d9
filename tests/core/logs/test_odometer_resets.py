"""Jumps of the odometer that the robot did not make, in drives whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import compose, relative
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log
from tests.core.mappers.slam.rooms import CORRIDOR, LASER, ROOM, scan_from

HALL = np.concatenate(
    (CORRIDOR, [(x, y, x, y - np.sign(y) * depth) for x, y, depth in (
        (-9.0, 1.0, 0.3), (-4.0, -1.0, 0.2), (1.0, 1.0, 0.25), (7.0, -1.0, 0.3), (13.0, 1.0, 0.2)
    )], [(30.0, -1.0, 30.0, 1.0)])
)  # fmt: skip
"""A corridor with pillars at its walls, and an end."""


def drive(
    scans: int = 40, *, speed: float = 0.5, every: float = 0.2, turn: float = 0.15,
    walls: np.ndarray = ROOM, start: tuple[float, ...] = (-1.5, -1.5, 0.2),
) -> Log:  # fmt: skip
    """A drive along an arc, with an exact odometer."""
    rng = np.random.default_rng(0)
    step = np.array((speed * every, 0.0, turn * every))
    poses = [np.array(start)]
    for _ in range(scans - 1):
        poses.append(compose(poses[-1], step))
    ranges = np.stack([scan_from(pose, walls).ranges for pose in poses])
    return Log(
        name="drive",
        geometry=LASER,
        stamps=every * np.arange(scans),
        ranges=ranges + rng.normal(0.0, 0.01, ranges.shape),
        odometry=np.stack(poses),
    )


def motions(log: Log) -> np.ndarray:
    return np.stack([reading.motion for reading in log.readings])


def with_reset(log: Log, scan: int, jump: np.ndarray) -> Log:
    """The log with a jump of the odometer before a scan, in the frame of the scan before."""
    moves = relative(log.odometry[:-1], log.odometry[1:])
    moves[scan - 1] = compose(jump, moves[scan - 1])
    poses = [log.odometry[0]]
    for move in moves:
        poses.append(compose(poses[-1], move))
    return replace(log, odometry=np.array(poses))


def without(log: Log, first: int, last: int) -> Log:
    """The log without some scans, as where a recorder failed for a while."""
    kept = np.r_[0:first, last : len(log.stamps)]
    ranges = None if log.ranges is None else log.ranges[kept]
    return replace(log, stamps=log.stamps[kept], odometry=log.odometry[kept], ranges=ranges)


@given(
    scan=st.integers(1, 39),
    jump=st.floats(3.0, 40.0),
    way=st.floats(-3.1, 3.1),
    turn=st.floats(-3.1, 3.1),
    speed=st.sampled_from((0.3, 1.0)),
)
@example(scan=1, jump=3.0, way=0.0, turn=0.0, speed=0.3)
@example(scan=39, jump=10.0, way=1.0, turn=3.1, speed=1.0)
@settings(max_examples=25, deadline=None)
def test_a_reset_is_found_and_the_scans_tell_the_motion(scan, jump, way, turn, speed):
    log = drive(speed=speed, turn=0.6)
    shift = np.array((jump * np.cos(way), jump * np.sin(way), turn))
    wrong = with_reset(log, scan, shift)
    assert [reset.scan for reset in wrong.resets] == [scan]
    off = relative(motions(log)[scan], wrong.resets[0].motion)
    assert wrong.resets[0].source == "scans"
    assert np.hypot(off[0], off[1]) < 0.03
    assert abs(off[2]) < np.radians(1.0)
    others = np.arange(len(log.stamps)) != scan
    np.testing.assert_allclose(motions(wrong)[others], motions(log)[others], atol=1e-9)
    assert wrong.path_length == pytest.approx(log.path_length, abs=0.05)


def test_several_resets_are_told_each_with_its_scan():
    log = drive()
    wrong = with_reset(with_reset(log, 10, np.array((4.0, 0.0, 0.0))), 30, np.array((-9.0, 2.0, 1)))
    first, second = map(str, wrong.resets)
    assert first.startswith(
        "at scan 11 the odometer jumps by 4.10 m and 2°, which is taken for 0.1"
    )
    assert "at scan 31 the odometer jumps" in second
    assert second.endswith("by the scans")


def test_a_line_that_jumps_there_and_back_is_two_jumps():
    log = drive()
    odometry = log.odometry.copy()
    odometry[20] += (7.0, -3.0, 0.0)
    wrong = replace(log, odometry=odometry)
    assert [reset.scan for reset in wrong.resets] == [20, 21]
    np.testing.assert_allclose(motions(wrong), motions(log), atol=0.03)


def test_without_a_laser_speed_decides_and_the_robot_goes_on_as_before():
    log = replace(drive(speed=1.0), ranges=None, geometry=None)
    wrong = with_reset(log, 20, np.array((10.0, 0.0, 2.0)))
    assert [(reset.scan, reset.source) for reset in wrong.resets] == [(20, "speed")]
    np.testing.assert_allclose(motions(wrong), motions(log), atol=1e-6)


def test_a_scan_that_sees_nothing_leaves_it_to_speed():
    log = drive(speed=1.0)
    log.ranges[20] = np.inf
    wrong = with_reset(log, 20, np.array((10.0, 0.0, 2.0)))
    assert [(reset.scan, reset.source) for reset in wrong.resets] == [(20, "speed")]


@pytest.mark.parametrize("has_laser", [True, False])
def test_a_robot_that_was_not_recorded_for_a_while_is_believed(has_laser):
    log = drive(80, speed=1.0, walls=HALL, turn=0.0, start=(0.0, 0.0, 0.0))
    if not has_laser:
        log = replace(log, ranges=None, geometry=None)
    torn = without(log, 30, 55)
    assert motions(torn)[30, 0] == pytest.approx(5.2)
    assert torn.resets == ()


def test_a_fast_robot_and_a_dash_are_believed():
    """A car at 5 m/s; and a robot that is slow for long, and then fast."""
    car = replace(drive(speed=5.0, every=0.5, turn=0.0), ranges=None, geometry=None)
    assert motions(car)[5, 0] == pytest.approx(2.5)
    assert car.resets == ()
    speeds = np.full(100, 0.1)
    speeds[60:70] = 3.0
    dash = np.zeros((100, 3))
    dash[:, 0] = np.cumsum(0.5 * speeds)
    slow = Log(name="dash", geometry=None, stamps=0.5 * np.arange(100), ranges=None, odometry=dash)
    assert slow.resets == ()


def test_late_stamps_are_no_jumps():
    rng = np.random.default_rng(1)
    log = replace(drive(speed=1.0), ranges=None, geometry=None)
    late = replace(log, stamps=log.stamps + np.where(rng.random(40) < 0.3, 0.199, 0.0))
    assert (np.diff(late.stamps) < 0.002).any()
    assert late.resets == ()


@pytest.mark.parametrize("stamps", [np.zeros(40), np.arange(40.0), np.repeat((1e9, 1e9 + 1e4), 20)])
def test_without_a_clock_the_scans_decide(stamps):
    log = replace(drive(speed=1.0), stamps=stamps)
    assert log.resets == ()
    wrong = with_reset(log, 20, np.array((3.0, 1.0, 0.0)))
    assert [reset.scan for reset in wrong.resets] == [20]
    blind = replace(wrong, ranges=None, geometry=None)
    assert blind.resets == ()  # It may have driven there between two scans.


def test_without_a_clock_missing_scans_are_no_jump():
    log = drive(80, speed=1.0, walls=HALL, turn=0.0, start=(0.0, 0.0, 0.0))
    torn = without(log, 30, 55)
    assert replace(torn, stamps=np.zeros(len(torn.stamps))).resets == ()


def test_a_robot_that_was_carried_is_no_jump_of_the_odometer():
    log = drive()
    moved = np.stack(
        [scan_from(pose + np.array((2.0, 1.0, 1.0))).ranges for pose in log.odometry[20:]]
    )
    assert replace(log, ranges=np.concatenate((log.ranges[:20], moved))).resets == ()


@pytest.mark.parametrize("scans", [1, 2, 3])
def test_the_shortest_logs_have_no_jumps(scans):
    assert drive(scans).resets == ()


@pytest.mark.parametrize(
    "name",
    [
        "intel_raw.json.gz", "intel-corrected.log.gz", "aces-corrected.log.gz",
        "freiburg-101-corrected.log.gz", "wean_robotdata1.log.xz", "wean_robotdata2.log.xz",
        "duke_loop5.log.xz",
    ],
)  # fmt: skip
def test_real_logs_have_no_jumps_and_a_reset_is_found_in_each(name, data):
    log = read_log(data / "logs" / name)
    assert log.resets == ()
    middle = len(log.stamps) // 2
    assert [reset.scan for reset in with_reset(log, middle, np.array((6.0, 8.0, 1.0))).resets] == [
        middle
    ]
