"""Bags that are damaged, packed, split or of another kind; and what they claim and hold."""

from __future__ import annotations

import bz2
import re
import sqlite3
import struct
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from mcap.writer import CompressionType, Writer

from albot_core.errors import InputError, MissingFileError
from albot_core.file_kinds import kind_of
from albot_core.logs.reader import read_log
from albot_core.ros.bag import is_bag
from albot_core.ros.compression import unpack
from tests.core.ros.drives import Drive, write_ros1, write_ros2

DRIVE = Drive(scans=4, poses=20)
_MIB = 1 << 20


def metadata(bag: Path, **changes: Any) -> None:
    """Change what the metadata says."""
    path = bag / "metadata.yaml"
    said = yaml.safe_load(path.read_text())
    said["rosbag2_bagfile_information"] |= changes
    path.write_text(yaml.safe_dump(said))


def test_split_bags_are_one(tmp_path: Path) -> None:
    sent = list(DRIVE.messages())
    whole = read_log(write_ros2(sent, tmp_path / "whole"))
    bag = write_ros2(sent[:20], tmp_path / "bag")
    more = write_ros2(sent[20:], tmp_path / "more") / "more.mcap"
    more.rename(bag / "more.mcap")
    metadata(bag, relative_file_paths=["bag/bag.mcap", "more.mcap"])
    log = read_log(bag)
    np.testing.assert_array_equal(log.ranges, whole.ranges)
    np.testing.assert_array_equal(log.odometry, whole.odometry)


@pytest.mark.parametrize("form", ["ros1", "mcap", "sqlite3"])
def test_a_torn_file_is_one_clear_error(form: str, tmp_path: Path) -> None:
    if form == "ros1":
        path = file = write_ros1(DRIVE.messages(), tmp_path / "a.bag")
    else:
        path = write_ros2(DRIVE.messages(), tmp_path / "a", form)
        file = path / ("a.mcap" if form == "mcap" else "a.db3")
    whole = file.read_bytes()
    for part in (0.02, 0.5, 0.9, 0.999):
        file.write_bytes(whole[: int(len(whole) * part)])
        expected = f"{file}: expected an intact ROS bag"
        with pytest.raises(InputError, match=re.escape(expected)):
            read_log(path)


@pytest.mark.parametrize("form", ["ros1", "mcap", "mode", "file"])
def test_an_unknown_compression_is_one_clear_error(form: str, tmp_path: Path) -> None:
    if form == "ros1":
        path = file = write_ros1(DRIVE.messages(), tmp_path / "a.bag", "lz4")
        old, new, found = b"compression=lz4", b"compression=zip", "'zip' is not supported"
    else:
        path = write_ros2(DRIVE.messages(), tmp_path / "a", "mcap", "storage")
        file, old, new = path / "a.mcap", b"\x04\0\0\0zstd", b"\x04\0\0\0gzip"
        found = "expected a compression of none, bz2, lz4, zstd, found 'gzip'"
    if form in ("mode", "file"):
        mode = "zip" if form == "mode" else "FILE"
        metadata(path, compression_mode=mode, compression_format="gzip")
        found = "expected none, file or message, found 'zip'" if form == "mode" else found
    else:
        file.write_bytes(file.read_bytes().replace(old, new))
    with pytest.raises(InputError, match=re.escape(found)):
        read_log(path)


def _bomb(stream: Any, compression: str) -> None:
    writer = Writer(stream, chunk_size=1 << 30, compression=CompressionType[compression])
    writer.start(profile="ros2")
    schema = writer.register_schema("sensor_msgs/msg/LaserScan", "ros2msg", b"")
    channel = writer.register_channel("/scan", "cdr", schema)
    odometry = writer.register_schema("nav_msgs/msg/Odometry", "ros2msg", b"")
    writer.register_channel("/odom", "cdr", odometry)
    writer.add_message(channel, 0, bytes(200 * _MIB), 0)
    writer.finish()


_READ = """
import re, resource, sys
from pathlib import Path
from albot_core.errors import InputError
from albot_core.logs.reader import read_log
import rosbags.rosbag1
data = int(re.search(r"VmData:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) * 1024
resource.setrlimit(resource.RLIMIT_DATA, (data + 500_000_000,) * 2)
for path in sys.argv[1:]:
    try:
        read_log(path)
    except InputError as error:
        print(error)
"""
"""Reads files within 500 MB, and prints what is said of each."""


def _huge_ros1(path: Path, at: bytes, size: int) -> Path:
    """A bag of ROS 1 with a length that cannot be true."""
    content = bytearray(write_ros1(DRIVE.messages(), path).read_bytes())
    place = content.index(at)
    content[place - size : place - size + 4] = struct.pack("<I", 0xFFFFFFF0)
    path.write_bytes(content)
    return path


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="limits memory as Linux does")
def test_what_claims_to_be_huge_or_unpacks_to_it_is_refused_within_500_mb(tmp_path: Path) -> None:
    paths = []
    for name in ("ZSTD", "LZ4"):
        with (tmp_path / f"{name}.mcap").open("wb") as stream:
            _bomb(stream, name)
        paths.append(tmp_path / f"{name}.mcap")
    paths.append(_huge_ros1(tmp_path / "chunk.bag", b"chunk_pos=", 12))
    packed = write_ros2(DRIVE.messages(), tmp_path / "message", "sqlite3", "message")
    with sqlite3.connect(packed / "message.db3") as database:
        bomb = zstandard.compress(bytes(200 * _MIB))
        database.execute("UPDATE messages SET data = ?", (bomb,))
    paths.append(packed)
    claimed = write_ros2(DRIVE.messages(), tmp_path / "claimed") / "claimed.mcap"
    content = bytearray(claimed.read_bytes())
    content[9:17] = struct.pack("<Q", 2**62)
    claimed.write_bytes(content)
    paths.append(claimed)
    assert max(path.stat().st_size for path in paths) < 2 * _MIB
    command = [sys.executable, "-c", _READ, *map(str, paths)]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    said = ran.stdout.splitlines()
    assert len(said) == len(paths)
    for line in said[:2] + said[3:4]:
        assert "134,217,728 bytes at most in a part of a bag" in line


@pytest.mark.parametrize(
    ("compression", "pack"),
    [("bz2", bz2.compress), ("lz4", lz4.frame.compress), ("zstd", zstandard.compress)],
)
def test_unpacking_ends_at_the_limit(
    compression: str, pack: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    packed = pack(bytes(1000))
    assert unpack(packed, compression, tmp_path, 1000) == bytes(1000)
    with pytest.raises(InputError, match="999 bytes at most in a part of a bag, found"):
        unpack(packed, compression, tmp_path, 999)


def test_chunks_of_ros_1_are_unpacked_within_a_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_ros1(DRIVE.messages(), tmp_path / "a.bag", "bz2")
    read_log(path)
    monkeypatch.setattr("albot_core.ros.bag.unpack", partial(unpack, largest=100))
    with pytest.raises(InputError, match="100 bytes at most"):
        read_log(path)


def test_bags_are_told_from_what_is_none(tmp_path: Path) -> None:
    bag = write_ros2(DRIVE.messages(), tmp_path / "a", "mcap", "storage")
    assert is_bag(bag)
    assert is_bag(bag / "a.mcap")
    assert kind_of(bag) == kind_of(bag / "a.mcap") == "a ROS bag"
    assert not is_bag(tmp_path)
    assert not is_bag(bag / "metadata.yaml")
    assert not is_bag(tmp_path / "none")
    with pytest.raises(MissingFileError):
        read_log(tmp_path / "none.bag")


def test_metadata_that_is_none_is_told(tmp_path: Path) -> None:
    bag = write_ros2(DRIVE.messages(), tmp_path / "a")
    for changes, expected in (
        ({"relative_file_paths": ["b.mcap"]}, "the file b.mcap in the folder, found none"),
        ({"relative_file_paths": []}, "relative_file_paths: expected a list of names"),
        ({"relative_file_paths": ["../../etc/passwd"]}, "the file passwd in the folder"),
        ({"relative_file_paths": ["metadata.yaml"]}, "a file of a ROS bag: .bag, .mcap or .db3"),
    ):
        metadata(bag, **changes)
        with pytest.raises(InputError, match=re.escape(expected)):
            read_log(bag)
    (bag / "metadata.yaml").write_text("a: b\n")
    with pytest.raises(InputError, match="the key rosbag2_bagfile_information"):
        read_log(bag)


def test_an_mcap_file_without_a_summary_is_read(tmp_path: Path) -> None:
    """As `mcap` writes where nobody can seek; its channels are in the chunks alone."""
    bag = write_ros2(DRIVE.messages(), tmp_path / "a")
    whole = read_log(bag)
    bare = bag / "a.mcap"
    content = bare.read_bytes()
    end = struct.unpack("<Q", content[-28:-20])[0]
    footer = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + content[-8:]
    bare.write_bytes(content[:end] + footer)
    np.testing.assert_array_equal(read_log(bare).ranges, whole.ranges)
