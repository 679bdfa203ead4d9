"""What a damaged log gets: one line that says where and what, or its good beginning."""

from __future__ import annotations

import gzip
import lzma
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log

FUZZ = settings(
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def _edit(text: str, line: int, word: int, new: str | None) -> str:
    """The text with a word of a line (from 1) replaced, or with the words from it on gone."""
    lines = text.split("\n")
    words = lines[line - 1].split()
    words[word:] = [] if new is None else [new, *words[word:][1:]]
    lines[line - 1] = " ".join(words)
    return "\n".join(lines)


def _number_of(text: str, keyword: str, which: int) -> int:
    """The number of the line where a keyword stands for the `which`-th time (from 0)."""
    numbers = [n for n, line in enumerate(text.split("\n"), 1) if line.startswith(keyword)]
    return numbers[which]


SCAN = {
    "carmen": "FLASER",
    "robotlaser": "ROBOTLASER1",
    "corrected": "FLASER",
    "wean": "L",
    "duke": "Laser",
}
FIRST_RANGE = {"carmen": 2, "robotlaser": 9, "corrected": 2, "wean": 7, "duke": 2}
POSE = {"carmen": -6, "robotlaser": -11, "corrected": -6, "wean": 1}


@pytest.fixture(params=sorted(SCAN))
def line_kind(request):
    return request.param


def _expect_error(path: Path, line: int, *words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_log(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, line {line}: expected ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_nan_is_named(line_kind, write, log_text):
    text = log_text(line_kind)
    line = _number_of(text, SCAN[line_kind], 3)
    bad = _edit(text, line, FIRST_RANGE[line_kind] + 5, "nan")
    _expect_error(write(bad), line, "found nan")


def test_a_negative_range_is_named(line_kind, write, log_text):
    text = log_text(line_kind)
    line = _number_of(text, SCAN[line_kind], 3)
    bad = _edit(text, line, FIRST_RANGE[line_kind], "-1.5")
    _expect_error(write(bad), line, "found -1.5")


@pytest.mark.parametrize("kind", sorted(POSE))
@pytest.mark.parametrize("number", ["nan", "inf", "-1e300", "x7"])
def test_a_pose_that_is_none_is_named(kind, number, write, log_text):
    text = log_text(kind)
    line = _number_of(text, SCAN[kind], 3)
    _expect_error(write(_edit(text, line, POSE[kind], number)), line, number)


def test_a_line_cut_off_is_named(line_kind, write, log_text):
    text = log_text(line_kind)
    line = _number_of(text, SCAN[line_kind], 3)
    _expect_error(write(_edit(text, line, 40, None)), line)


def test_another_number_of_beams_is_named(line_kind, drive, write, log_text):
    text = log_text(line_kind)
    line = _number_of(text, SCAN[line_kind], 3)
    lines = text.split("\n")
    other = {180: 181, 181: 180, 361: 360}[drive(line_kind).ranges.shape[1]]
    full = type(drive(line_kind))(other)
    writer = {
        "carmen": full.carmen,
        "robotlaser": full.robotlaser,
        "corrected": full.corrected_log,
        "wean": full.wean,
        "duke": full.duke,
    }[line_kind]
    lines[line - 1] = writer().split("\n")[line - 1]
    _expect_error(write("\n".join(lines)), line, "first scan", str(other))


def test_an_unknown_number_of_beams_is_named(drive, write):
    _expect_error(write(type(drive("carmen"))(77).carmen()), 5, "180, 181, 360 or 361", "77")
    with pytest.raises(InputError, match="360 or 361 ranges, found 77"):
        read_log(write(type(drive("json"))(77).json()))


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ('"theta"', '"yaw"', "no theta"),
        ('"range": [', '"range": [NaN, ', "nan"),
        ('"range": [', '"range": [null, ', "'None'"),
        ('"x": ', '"x": "here", "z": ', "'here'"),
        ('"range": [', '"range": [1.0, ', "181"),
        ('"range": [', '"range": 3, "more": [', "range 3"),
        ("},", "}", "'\"'"),
        ('"x": ', '"x": 1e400, "z": ', "1e400"),
    ],
)
def test_damaged_json_is_named(old, new, found, write, log_text):
    head, entry, tail = log_text("json").partition('"102.')
    with pytest.raises(InputError) as caught:
        read_log(write(head + entry + tail.replace(old, new, 1)))
    assert caught.value.found == found
    assert caught.value.place.startswith("line ")


@pytest.mark.parametrize("text", ['{"map": 3}', '{"map": {"1": 3}}', '{"map"', "{", '{"a": 1}'])
def test_json_that_is_no_log_is_refused(text, write):
    for keep_going in (False, True):
        with pytest.raises(InputError):
            read_log(write(text), keep_going)


def test_json_nested_too_deep_is_refused(write):
    with pytest.raises(InputError, match="nested too deep"):
        read_log(write('{"map": {"1": ' + "[" * 100_000))


def test_numbers_without_end_are_refused(write, log_text):
    long = "9" * 5000
    with pytest.raises(InputError, match="numbers of a common size"):
        read_log(write(log_text("json").replace('"range": [', f'"range": [{long}, ', 1)))
    text = log_text("carmen")
    line = _number_of(text, "FLASER", 2)
    _expect_error(write(_edit(text, line, 1, long)), line, "the number of beams")


@pytest.mark.parametrize("kind", ["carmen", "wean", "duke", "json"])
def test_a_range_too_large_to_be_a_number_is_no_missing_return(kind, write, log_text):
    """Read as a number it is infinite, which lasers say where nothing comes back."""
    text = log_text(kind)
    first = {"carmen": "FLASER", "wean": "L", "duke": "Laser"}.get(kind)
    with pytest.raises(InputError, match=r"line \d+: .*1e400"):
        if first is None:
            read_log(write(text.replace('"range": [', '"range": [1e400, ', 1)))
        else:
            read_log(write(_edit(text, _number_of(text, first, 2), 9, "1e400")))
    if first is not None:
        read_log(write(_edit(text, _number_of(text, first, 2), 9, "Infinity")))


def test_a_laser_line_without_its_odometry_is_named(write, log_text):
    text = log_text("duke")
    line = _number_of(text, "Odometry", 2)
    lines = text.split("\n")
    del lines[line - 1]
    _expect_error(write("\n".join(lines)), line, "an Odometry line before each Laser line")


def test_a_robotlaser_of_another_make_is_named(write, log_text):
    text = log_text("robotlaser")
    _expect_error(write(_edit(text, 3, 2, "-2.35")), 3, "the laser of the first scan")
    _expect_error(write(_edit(text, 1, 4, "0.0")), 1, "0 rad")


def test_a_laser_that_strays_on_the_robot_is_refused(write, log_text):
    text = log_text("wean")
    with pytest.raises(InputError, match="a laser with a constant mount"):
        read_log(write(_edit(text, _number_of(text, "L", 2), 4, "5000.0")))


def test_keep_going_leaves_out_bad_lines_alone(line_kind, write, log_text):
    text = log_text(line_kind)
    whole = read_log(write(text))
    bad = [0, 3, 4]
    lines = [_number_of(text, SCAN[line_kind], scan) for scan in bad]
    for line in lines:
        text = _edit(text, line, FIRST_RANGE[line_kind], "nan")
    log = read_log(write(text), keep_going=True)
    np.testing.assert_array_equal(log.ranges, np.delete(whole.ranges, bad, axis=0))
    if line_kind != "corrected":  # Its odometer goes on from scan to scan.
        np.testing.assert_array_equal(log.odometry, np.delete(whole.odometry, bad, axis=0))
    assert log.unread is not None
    assert (log.unread.lines, log.unread.scans) == (3, 3)
    where = re.findall(r"\d+", log.unread.where.replace(" to ", ", "))
    assert {int(number) for number in where} == set(lines)
    assert f"line {lines[0]}: " in log.unread.reason


@pytest.mark.parametrize("kind", ["carmen", "corrected", "wean", "duke"])
def test_keep_going_leaves_out_a_bad_line_before_the_first_scan(kind, write, log_text):
    text = log_text(kind)
    bad = {"wean": "O 1 2", "duke": "Odometry 1 2"}.get(kind, "ODOM 1 2 x 0 0 0 1 robot 1")
    whole, path = read_log(write(text)), write(f"{bad}\n{text}")
    with pytest.raises(InputError, match="line 1"):
        read_log(path)
    log = read_log(path, keep_going=True)
    np.testing.assert_array_equal(log.ranges, whole.ranges)
    np.testing.assert_array_equal(log.odometry, whole.odometry)
    assert log.unread is not None
    assert (log.unread.lines, log.unread.scans, log.unread.where) == (1, 0, "line 1")


def test_keep_going_leaves_out_a_first_scan_cut_off(line_kind, write, log_text):
    """It does not decide how many the others must have."""
    text = log_text(line_kind)
    whole = read_log(write(text))
    line = _number_of(text, SCAN[line_kind], 0)
    log = read_log(write(_edit(text, line, 40, None)), keep_going=True)
    np.testing.assert_array_equal(log.ranges, whole.ranges[1:])


def test_keep_going_leaves_out_bad_entries_of_json(write, log_text):
    text = log_text("json")
    whole = read_log(write(text))
    head, entry, tail = text.partition('"102.')
    log = read_log(write(head + entry + tail.replace('"range": [', '"range": [NaN, ', 1)), True)
    number = head.count('"range"')
    np.testing.assert_array_equal(log.ranges, np.delete(whole.ranges, number, axis=0))
    assert log.unread is not None
    first, count = head.count("\n") + 1, tail[: tail.index("}")].count("\n") + 1
    assert (log.unread.lines, log.unread.scans) == (count, 1)
    assert log.unread.where == f"lines {first} to {first + count - 1}"


def test_what_follows_a_place_that_is_no_json_is_left_out(write, log_text):
    text = log_text("json")
    whole = read_log(write(text))
    good = text.index('"102.')
    cut = text.index('"range"', good) + 300
    log = read_log(write(text[:cut]), keep_going=True)
    np.testing.assert_array_equal(log.ranges, whole.ranges[: len(log.stamps)])
    assert 0 < len(log.stamps) < len(whole.stamps)
    assert log.unread is not None
    assert log.unread.scans == 1
    tail = read_log(write(text[:-2]), keep_going=True)
    assert len(tail.stamps) == len(whole.stamps)
    assert tail.unread is not None
    assert tail.unread.scans == 0


def test_keep_going_needs_one_good_scan(line_kind, write, log_text):
    text = log_text(line_kind, scans=3)
    for scan in range(3):
        line = _number_of(text, SCAN[line_kind], scan)
        text = _edit(text, line, FIRST_RANGE[line_kind], "nan")
    first = _number_of(text, SCAN[line_kind], 0)
    with pytest.raises(InputError, match=f"line {first}: .* nan"):
        read_log(write(text), keep_going=True)


def test_keep_going_changes_nothing_of_a_whole_log(kind, write, log_text):
    path = write(log_text(kind))
    one, other = read_log(path), read_log(path, keep_going=True)
    assert other.unread is None
    np.testing.assert_array_equal(one.ranges, other.ranges)


@pytest.mark.parametrize("suffix", [".gz", ".xz"])
def test_what_is_packed_and_not_named_so_is_told(tmp_path, suffix):
    path = tmp_path / "a.log"
    path.write_bytes({".gz": gzip.compress, ".xz": lzma.compress}[suffix](b"O 0 0 0 1\n" * 30))
    with pytest.raises(InputError, match=rf"a\.log: expected a name that ends in \{suffix}"):
        read_log(path)


@pytest.mark.parametrize("suffix", [".gz", ".xz"])
def test_a_torn_archive(kind, suffix, tmp_path, write, log_text, drive):
    pack = {".gz": gzip.compress, ".xz": lzma.compress}[suffix]
    text = log_text(kind, scans=120)
    packed = pack(text.encode())
    path = tmp_path / f"torn.log{suffix}"
    path.write_bytes(packed[: len(packed) * 2 // 3])
    with pytest.raises(InputError, match=f"intact {suffix[1:]} data"):
        read_log(path)
    log = read_log(path, keep_going=True)
    whole = read_log(write(text))
    assert 0 < len(log.stamps) < len(whole.stamps)
    np.testing.assert_array_equal(log.ranges, whole.ranges[: len(log.stamps)])
    assert log.unread is not None
    assert f"intact {suffix[1:]} data" in log.unread.reason


def _assert_sound_or_refused(path: Path, content: bytes, keep_going: bool) -> Log | None:
    """A log that is read is sound; one that is not gets the one error that bad input gets.

    Returns the log that was read.
    """
    path.write_bytes(content)
    try:
        log = read_log(path, keep_going)
    except InputError as error:
        assert "\n" not in str(error)
        assert str(error).startswith(str(path))
        return None
    assert np.isfinite(log.odometry).all()
    assert np.isfinite(log.stamps).all()
    assert (log.ranges > 0).all()
    assert (np.diff(log.times) >= 0).all()
    assert len(log.readings) == len(log.stamps) > 0
    return log


def _assert_begins(log: Log, whole: Log) -> None:
    """What was read of a log that was cut is the beginning of the whole one."""
    count = len(log.stamps)
    np.testing.assert_array_equal(log.ranges, whole.ranges[:count])
    np.testing.assert_array_equal(log.stamps, whole.stamps[:count])
    np.testing.assert_array_equal(log.odometry, whole.odometry[:count])


def test_a_log_cut_within_the_last_number_of_its_only_scan(kind, tmp_path, log_text):
    content = log_text(kind, scans=1).encode().rstrip()
    whole = _assert_sound_or_refused(tmp_path / "whole.log", content + b"\n", False)
    assert whole is not None
    for end in range(len(content) - 12, len(content)):
        log = _assert_sound_or_refused(tmp_path / "cut.log", content[:end], True)
        if log is not None:
            np.testing.assert_array_equal(log.ranges, whole.ranges)
            np.testing.assert_array_equal(log.stamps, whole.stamps)


@FUZZ
@given(share=st.floats(0, 1), keep_going=st.booleans())
def test_a_log_cut_at_any_byte(kind, share, keep_going, tmp_path, log_text):
    whole = _assert_sound_or_refused(tmp_path / "whole.log", log_text(kind).encode(), False)
    content = log_text(kind).encode()
    log = _assert_sound_or_refused(
        tmp_path / "cut.log", content[: round(share * len(content))], keep_going
    )
    assert whole is not None
    if log is not None:
        _assert_begins(log, whole)


def test_a_log_cut_at_every_byte_of_its_last_line(kind, tmp_path, log_text):
    content = log_text(kind, scans=3).encode()
    whole = _assert_sound_or_refused(tmp_path / "whole.log", content, False)
    assert whole is not None
    for end in range(len(content) - 150, len(content)):
        log = _assert_sound_or_refused(tmp_path / "cut.log", content[:end], True)
        assert log is not None
        assert len(log.stamps) >= 2
        _assert_begins(log, whole)


@FUZZ
@given(data=st.data(), keep_going=st.booleans())
def test_a_log_with_bytes_changed(kind, data, keep_going, tmp_path, log_text):
    content = bytearray(log_text(kind).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] = data.draw(st.integers(0, 255))
    _assert_sound_or_refused(tmp_path / "changed.log", bytes(content), keep_going)


@FUZZ
@given(share=st.floats(0, 1), suffix=st.sampled_from([".gz", ".xz"]), keep_going=st.booleans())
def test_an_archive_cut_at_any_byte(kind, share, suffix, keep_going, tmp_path, log_text):
    pack = {".gz": gzip.compress, ".xz": lzma.compress}[suffix]
    content = log_text(kind).encode()
    packed = pack(content)
    whole = _assert_sound_or_refused(tmp_path / "whole.log", content, False)
    cut = packed[: round(share * len(packed))]
    log = _assert_sound_or_refused(tmp_path / f"cut.log{suffix}", cut, keep_going)
    assert whole is not None
    if log is not None:
        _assert_begins(log, whole)


@FUZZ
@given(content=st.binary(max_size=300), keep_going=st.booleans())
def test_junk_is_refused(content, keep_going, tmp_path):
    assert _assert_sound_or_refused(tmp_path / "junk.log", content, keep_going) is None


def _without(text: str, lost: Callable[[int, str], bool]) -> str:
    """A corrected log without the `ODOM` lines before scans (from 0) for which `lost` is true.

    `lost` takes the scan's number, and whether the line is "before" or "after" it.
    """
    lines = []
    for block in text.split("FLASER"):
        before, *odometer = block.split("ODOM")
        lines.append((before, odometer))
    kept = [lines[0][0] + "".join(f"ODOM{line}" for line in lines[0][1])]
    for scan, (laser, odometer) in enumerate(lines[1:]):
        inner = odometer[1:]
        if lost(scan, "after"):
            odometer = inner
        if lost(scan + 1, "before") and inner:
            odometer = odometer[: len(odometer) - len(inner)]
        kept.append(laser + "".join(f"ODOM{line}" for line in odometer))
    return "FLASER".join(kept)


def test_one_lost_odom_line_loses_one_step(write, log_text):
    whole = read_log(write(log_text("corrected", scans=30)))
    text = _without(log_text("corrected", scans=30), lambda scan, at: (scan, at) == (12, "before"))
    log = read_log(write(text))
    assert log.notes == (
        "1 motion of the odometer is lost with the ODOM lines and taken as the mean of the steps "
        "before and after "
        f"(first scan 13, stamp {whole.stamps[12]:.6f})",
    )
    np.testing.assert_array_equal(log.reference, whole.reference)
    steps = [np.array([reading.motion for reading in each.readings]) for each in (whole, log)]
    np.testing.assert_allclose(
        np.delete(steps[0], 12, axis=0), np.delete(steps[1], 12, axis=0), atol=1e-9
    )
    np.testing.assert_allclose(steps[1][12], (steps[0][11] + steps[0][13]) / 2, atol=1e-9)


def test_a_scan_torn_from_its_odometer_lines_is_not_taken_for_odometry(write, log_text) -> None:
    whole = read_log(write(log_text("corrected")))
    lines = log_text("corrected").split("\n")
    scans = [n for n, line in enumerate(lines) if line.startswith("FLASER")]
    torn = scans[len(scans) // 2]
    lines.insert(torn - 4, lines.pop(torn))
    log = read_log(write("\n".join(lines)))
    np.testing.assert_array_equal(log.reference, whole.reference)
    assert "1 motion of the odometer is lost" in log.notes[0]


@pytest.mark.parametrize("left", [0, 3])
def test_where_most_odom_lines_are_lost_nothing_is_known_of_the_odometer(left, write, log_text):
    whole = read_log(write(log_text("corrected", scans=30)))
    text = _without(
        log_text("corrected", scans=30),
        lambda scan, at: at == "before" and (left == 0 or scan % (30 // left) != 1),
    )
    log = read_log(write(text))
    assert log.is_odometry_constant
    np.testing.assert_array_equal(log.reference, whole.reference)
    assert "of 30 lack the ODOM line before them; the scans' poses" in log.notes[0]


def test_without_the_lines_after_scans_nothing_is_lost(write, log_text):
    whole = read_log(write(log_text("corrected", scans=30)))
    log = read_log(write(_without(log_text("corrected", scans=30), lambda _, at: at == "after")))
    np.testing.assert_array_equal(log.reference, whole.reference)
    np.testing.assert_allclose(log.odometry, whole.odometry, atol=1e-9)
    assert log.notes == ()


def test_odom_lines_of_the_odometer_itself_are_read(drive, write):
    """GMapping's `gfs2log -odom`: corrected scans, and the odometer as it was."""
    text = drive("corrected", scans=30)
    lines = []
    for k, pose in enumerate(text.corrected):
        lines += [text.odom(text.odometry[k], text.stamps[k]), text.flaser(k, pose, pose)]
    log = read_log(write("\n".join(lines) + "\n"))
    np.testing.assert_allclose(log.reference, text.corrected)
    steps = [np.array(relative(poses[:-1], poses[1:])) for poses in (text.odometry, log.odometry)]
    np.testing.assert_allclose(steps[0], steps[1], atol=1e-9)
