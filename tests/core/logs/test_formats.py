from __future__ import annotations

import gzip
import lzma

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import read_relations
from albot_core.geometry.poses import compose, relative
from albot_core.logs.reader import FORMATS, read_log, read_reference
from tests.core.logs.conftest import WRITERS


def test_every_format_gives_what_was_written(kind, drive, write, log_text):
    truth = drive(kind)
    log = read_log(write(log_text(kind)))
    assert log.name == "run.log"
    assert log.unread is None
    np.testing.assert_allclose(log.ranges, truth.ranges, atol=1e-9)
    # A corrected log holds the odometer's steps to the rounding of its own poses.
    np.testing.assert_allclose(log.odometry, truth.odometry, atol=1e-5)
    if kind != "duke":
        np.testing.assert_allclose(log.stamps, truth.stamps, atol=1e-9)
    else:
        np.testing.assert_array_equal(log.stamps, np.arange(len(truth.stamps)))
    if kind == "corrected":
        np.testing.assert_allclose(log.reference, truth.corrected, atol=1e-9)
    else:
        assert log.reference is None


def test_readings_are_the_odometers_steps(kind, write, log_text):
    log = read_log(write(log_text(kind)))
    assert len(log.readings) == len(log.odometry)
    np.testing.assert_array_equal(log.readings[0].motion, np.zeros(3))
    pose = log.odometry[0]
    for reading, stamp, ranges, expected in zip(
        log.readings, log.stamps, log.ranges, log.odometry, strict=True
    ):
        pose = compose(pose, reading.motion)
        np.testing.assert_allclose(relative(expected, pose), 0, atol=1e-12)
        assert reading.stamp == stamp
        assert reading.laser.geometry is log.geometry
        np.testing.assert_array_equal(reading.laser.ranges, ranges)


@pytest.mark.parametrize(
    ("kind", "beams", "spacing", "max_range", "mount"),
    [
        ("carmen", 180, 1.0, 30.0, (0, 0, 0)),
        ("robotlaser", 361, 0.5, 12.5, (0.1, -0.2, 0)),
        ("corrected", 180, 1.0, 30.0, (0, 0, 0)),
        ("wean", 180, 1.0, 30.0, (0.25, 0, 0)),
        ("duke", 181, 1.0, 8.18, (0.4, 0, 0)),
        ("json", 180, 1.0, 30.0, (0, 0, 0)),
    ],
)
def test_the_laser_of_every_format(kind, beams, spacing, max_range, mount, write, log_text):
    laser = read_log(write(log_text(kind))).geometry
    assert laser.beams == beams
    assert laser.max_range == max_range
    assert laser.mount == pytest.approx(mount, abs=1e-4)
    # Beams run from the right to the left.
    assert np.rad2deg(laser.bearings[:2]) == pytest.approx((-90, -90 + spacing), abs=0.01)


def test_half_a_degree_between_360_beams(drive, write):
    text = drive("carmen")
    text.ranges = np.tile(text.ranges, (1, 2))
    log = read_log(write(text.carmen()))
    assert log.geometry.beams == 360
    assert np.rad2deg(log.geometry.bearings[-1]) == pytest.approx(89.5)


@pytest.mark.parametrize("suffix", [".gz", ".xz"])
def test_packed_logs_are_unpacked(kind, suffix, tmp_path, write, log_text):
    pack = {".gz": gzip.compress, ".xz": lzma.compress}[suffix]
    path = tmp_path / f"run.log{suffix}"
    path.write_bytes(pack(log_text(kind).encode()))
    plain = read_log(write(log_text(kind)))
    packed = read_log(path)
    np.testing.assert_array_equal(packed.ranges, plain.ranges)
    np.testing.assert_array_equal(packed.odometry, plain.odometry)


def test_scans_come_in_the_order_of_time(drive, write):
    shuffled = drive("carmen")
    straight = read_log(write(shuffled.carmen()))
    order = np.array((1, 0, 2, 5, 3, 4))
    for name in ("odometry", "stamps", "ranges"):
        setattr(shuffled, name, getattr(shuffled, name)[order])
    log = read_log(write(shuffled.carmen()))
    np.testing.assert_array_equal(log.stamps, straight.stamps)
    np.testing.assert_array_equal(log.ranges, straight.ranges)
    np.testing.assert_array_equal(
        [reading.motion for reading in log.readings],
        [reading.motion for reading in straight.readings],
    )
    assert log.notes == (
        "5 scans of 6 stood out of order and were sorted by stamp, the first of them scan 1",
    )


def test_scans_of_one_stamp_stay_as_they_stand(drive, write):
    text = drive("carmen", scans=60)
    text.stamps[:] = np.repeat((8.0, 7.0), 30)
    log = read_log(write(text.carmen()))
    np.testing.assert_array_equal(log.ranges, text.ranges)
    assert log.notes == (
        "the stamps do not tell the time (60 scans share 2 stamps); the scans stay in the file's "
        "order",
    )
    assert [reading.stamp for reading in log.readings] == list(range(60))


@pytest.mark.parametrize("kind", sorted({*WRITERS} - {"duke"}))
def test_scans_stay_as_they_stand_where_the_clock_steps_back(kind, drive, write):
    text = drive(kind, scans=60)
    text.stamps = 100.0 + 0.5 * np.arange(60)
    text.stamps[40:] -= 10.25
    log = read_log(write(WRITERS[kind](text)))
    np.testing.assert_allclose(log.ranges, text.ranges, atol=1e-9)
    np.testing.assert_allclose(log.stamps, text.stamps)
    assert "the clock steps back by 9.75 s at scan 41" in log.notes[0]
    np.testing.assert_allclose(
        [reading.stamp for reading in log.readings], 100.0 + 0.5 * np.arange(60)
    )


def test_first_stamps_that_descend_sort_nothing(drive, write):
    text = drive("carmen", scans=30)
    text.stamps = 100.0 + 0.5 * np.arange(30)
    text.stamps[:3] = text.stamps[2::-1]
    log = read_log(write(text.carmen()))
    np.testing.assert_array_equal(log.ranges, text.ranges)
    assert "steps back 2 times, first by 0.5 s at scan 2" in log.notes[0]


def test_ranges_beyond_reach_and_codes_of_fault_mean_no_return(drive, write):
    text = drive("carmen")
    text.ranges[0, :6] = (0.0, 29.99, 30.0, 50.0, 81.83, 81.91)
    log = read_log(write(text.carmen()))
    assert log.ranges[0, :6].tolist() == [np.inf, 29.99, np.inf, np.inf, np.inf, np.inf]


def test_the_header_of_a_robotlaser_tells_the_largest_range(drive, write):
    text = drive("robotlaser")
    text.ranges[0, :2] = (12.4, 12.6)
    log = read_log(write(text.robotlaser()))
    assert log.ranges[0, :2].tolist() == [12.4, np.inf]


@pytest.mark.parametrize(("kind", "degrees"), [(0, 0.5), (2, 0.0), (99, 0.0)])
def test_the_beams_of_a_sick_lms_are_known_to_be_wide(kind, degrees, drive, write):
    text = drive("robotlaser").robotlaser().replace("ROBOTLASER1 0 ", f"ROBOTLASER1 {kind} ")
    assert np.degrees(read_log(write(text)).geometry.beam_width) == pytest.approx(degrees)


@pytest.mark.parametrize(
    ("beams", "written", "spacing"),
    [
        (2, "1.57079633", np.pi / 2),
        (3, "1.5708", np.pi / 2),
        (3, "1.570796", 1.570796),
        (361, "0.0174533", np.pi / 180),
        (721, "0.008727", np.pi / 360),
    ],
)
def test_a_spacing_may_be_rounded_up(beams, written, spacing, drive, write):
    text = type(drive("robotlaser"))(beams).robotlaser().replace(" 0.008727 ", f" {written} ")
    assert read_log(write(text)).geometry.spacing == spacing


@pytest.mark.parametrize(
    ("beams", "written", "expected"),
    [
        (2, "1.58", "at most 1.5708 rad with 2 beams, found 1.58 rad"),
        (3, "-1.58", "a spacing above 0, and at most 1.5708 rad with 3 beams, found -1.58 rad"),
        (3, "0", "above 0, and at most 1.5708 rad with 3 beams, found 0 rad"),
        (361, "0.0175", "at most 0.0174533 rad with 361 beams, found 0.0175 rad"),
    ],
)
def test_a_spacing_that_cannot_be_is_told(beams, written, expected, drive, write):
    text = type(drive("robotlaser"))(beams).robotlaser().replace(" 0.008727 ", f" {written} ")
    with pytest.raises(InputError, match=expected) as caught:
        read_log(write(text))
    assert "line 1: expected a spacing" in str(caught.value)


@pytest.mark.parametrize("start", ["-1.570796", "1.570796"])
def test_the_beams_of_a_laser_upside_down_run_from_left_to_right(start, drive, write):
    text = drive("robotlaser")
    right = read_log(write(text.robotlaser()))
    text.ranges = text.ranges[:, ::-1]
    turned = text.robotlaser().replace(
        " -1.570796 3.141593 0.008727 ", f" {start} -3.141593 -0.008727 "
    )
    log = read_log(write(turned))
    np.testing.assert_array_equal(log.ranges, right.ranges)
    np.testing.assert_allclose(log.geometry.bearings, right.geometry.bearings, atol=1e-3)


@pytest.mark.parametrize("remissions", [None, 0, 1, 361])
def test_robotlaser_with_and_without_remissions(remissions, drive, write):
    text = drive("robotlaser")
    log = read_log(write(text.robotlaser(remissions)))
    np.testing.assert_allclose(log.ranges, text.ranges)
    np.testing.assert_allclose(log.odometry, text.odometry)


def test_a_laser_that_looks_back(drive, write):
    text = drive("carmen")
    back = compose(text.odometry, np.array((-0.2, 0.0, np.pi)))
    lines = [
        text.flaser(k, laser, robot)
        for k, (laser, robot) in enumerate(zip(back, text.odometry, strict=True))
    ]
    log = read_log(write("\n".join(lines) + "\n"))
    assert log.reference is None
    x, y, heading = log.geometry.mount
    assert (x, y) == pytest.approx((-0.2, 0.0), abs=1e-4)
    assert np.abs(heading) == pytest.approx(np.pi, abs=1e-4)


def test_of_two_kinds_of_scans_the_first_is_read(drive, write, log_text):
    log = read_log(write(log_text("carmen") + log_text("robotlaser")))
    assert log.geometry.beams == 180
    assert len(log.stamps) == len(drive("carmen").stamps)


def test_a_first_pose_that_wanders_is_the_reference(drive, write):
    text = drive("carmen")
    lines = [
        text.flaser(k, corrected, raw)
        for k, (corrected, raw) in enumerate(zip(text.corrected, text.odometry, strict=True))
    ]
    log = read_log(write("\n".join(lines) + "\n"))
    np.testing.assert_allclose(log.odometry, text.odometry)
    np.testing.assert_allclose(log.reference, text.corrected)


def test_a_raw_log_with_odometry_after_each_scan_is_not_taken_for_a_corrected_one(drive, write):
    text = drive("carmen")
    lines = []
    for k, pose in enumerate(text.odometry):
        lines += [text.flaser(k, pose, pose), text.odom(pose, text.stamps[k])]
    log = read_log(write("\n".join(lines) + "\n"))
    assert log.reference is None
    np.testing.assert_allclose(log.odometry, text.odometry)


def test_a_corrected_log_out_of_time_order_keeps_its_odometry(drive, write):
    text = drive("corrected")
    text.stamps = text.stamps[[0, 2, 1, 3, 4, 5]]
    log = read_log(write(text.corrected_log()))
    np.testing.assert_allclose(log.odometry, text.odometry, atol=1e-5)
    np.testing.assert_allclose(log.reference, text.corrected, atol=1e-9)


def test_byte_order_marks_are_no_matter(kind, tmp_path, write, log_text):
    """Windows editors put one at the beginning; `cat` brings more into the middle."""
    plain = read_log(write(log_text(kind)))
    first, *rest = log_text(kind).split("\n")
    marked = "\ufeff" + "\n".join((first, *(f"\ufeff{line}" if line else line for line in rest)))
    for name, content in (
        ("bom.log", f"\ufeff{log_text(kind)}".encode()),
        ("bom.log.gz", gzip.compress(f"\ufeff{log_text(kind)}".encode())),
        ("joined.log", marked.encode()),
    ):
        (tmp_path / name).write_bytes(content)
        log = read_log(tmp_path / name)
        np.testing.assert_array_equal(log.ranges, plain.ranges)
        np.testing.assert_array_equal(log.odometry, plain.odometry)
    (tmp_path / "wide.log").write_bytes(log_text(kind).encode("utf-16"))
    with pytest.raises(InputError, match="expected UTF-8 text, found UTF-16 text; convert it"):
        read_log(tmp_path / "wide.log")


@pytest.mark.parametrize("name", ["a.tum", "a.txt"])
def test_a_byte_order_mark_before_a_reference_or_relations(name, tmp_path):
    (tmp_path / name).write_text("\ufeff1 10 0 0 0 0 0 1\n2 20 0 0 0 0 0 1\n", encoding="utf-8")
    assert read_reference(tmp_path / name).stamps.tolist() == [1, 2]
    (tmp_path / "a.relations").write_text("\ufeff1 2 10 0 0 0 0 0\n", encoding="utf-8")
    assert read_relations(tmp_path / "a.relations").stamps.tolist() == [[1, 2]]


def test_carriage_returns_are_no_matter(kind, write, log_text):
    log = read_log(write(log_text(kind).replace("\n", "\r\n")))
    np.testing.assert_array_equal(log.ranges, read_log(write(log_text(kind))).ranges)


@pytest.mark.parametrize("kind", ["carmen", "robotlaser", "wean", "duke"])
def test_a_last_line_without_its_end_is_read_if_whole(kind, write, log_text):
    log = read_log(write(log_text(kind).rstrip()))
    assert len(log.stamps) == len(read_log(write(log_text(kind))).stamps)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "an empty file"),
        (b" \n\n", "an empty file"),
        (b"\x7fELF\x00\x01\x02", "binary data"),
        (b"PK\x03\x04\x14\x00\x08\x00\nL 1 2\n", "a zip archive"),
        (b"Dear diary,\ntoday I drove.\n", "'Dear diary,'"),
        (b"pose2 0 1 2\n", "'pose2 0 1 2'"),
    ],
)
def test_what_is_no_log_is_named(content, found, tmp_path):
    path = tmp_path / "what.log"
    path.write_bytes(content)
    for keep_going in (False, True):
        with pytest.raises(InputError) as caught:
            read_log(path, keep_going)
        assert caught.value.found == found
        assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "line", ["odom2 0 0.1 0 0 1 1 1", " " * 50 + "odom2 0 0.1", "point2 0 1 2", "loop 3 1 0.9"]
)
def test_librsfs_files_are_told_what_to_convert(line, write):
    for read in (read_log, read_reference):
        with pytest.raises(InputError, match=r"a line of libRSF, .*; convert its sensor data"):
            read(write(f"{line}\n"))


def test_the_error_of_an_unknown_format_lists_the_known_ones(write):
    with pytest.raises(InputError) as caught:
        read_log(write("Dear diary\n"))
    assert all(known in str(caught.value) for known in FORMATS)


def test_a_log_without_scans_is_refused(write):
    with pytest.raises(InputError, match="a FLASER or ROBOTLASER1 line"):
        read_log(write("PARAM robot_length 0.5 nohost 0\nODOM 0 0 0 0 0 0 1 robot 1\n"))
    with pytest.raises(InputError, match="at least one L line"):
        read_log(write("O 1 2 3 4\n"))
    with pytest.raises(InputError, match="at least one Laser line"):
        read_log(write("Odometry 1 2 3\n"))
    with pytest.raises(InputError, match="at least one scan"):
        read_log(write('{"map": {}}'))


def test_a_missing_log_and_a_folder(tmp_path):
    with pytest.raises(InputError, match="file not found"):
        read_log(tmp_path / "none.log")
    with pytest.raises(InputError, match="a folder"):
        read_log(tmp_path)
