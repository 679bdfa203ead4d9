"""What a file is, told by its content."""

from __future__ import annotations

import gzip
import io
import zipfile
from pathlib import Path

import pytest

from albot_core.file_kinds import kind_of
from albot_core.mappers.map_file import save_map
from albot_core.mappers.registry import make_mapper

DUKE = "Odometry 0 0 0\nLaser 180 " + " ".join(["1.0"] * 180) + "\n"


def _archive(header: str) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        # Without the time of now, which would be part of a test's name.
        archive.writestr(zipfile.ZipInfo("header.json"), header)
    return packed.getvalue()


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"\x89MCAP0\r\n", "a recorded episode"),
        (b"#ROSBAG V2.0\n", "a ROS bag"),
        (b"SQLite format 3\0", "a ROS bag"),
        (b"\x89PNG\r\n", "a picture"),
        (DUKE.encode(), "a robot's log, Duke (Odometry and Laser lines)"),
        (b'{"map": {"1": {"range": [], "x": 0, "y": 0, "theta": 0}}}', "a robot's log, JSON"),
        (b'{"map": 3}', ""),
        (b"# ours\nalbot-world: 1\n", "a world in albot-world YAML"),
        (b'{"verts": []}', "a HouseExpo house"),
        (b"task: Albot/Homing-v0\n", "a training plan"),
        (_archive('{"format": "albot-agent"}'), "the file of a trained agent"),
        (_archive("{}"), "a zip archive"),
        (_archive("{}")[:20], ""),
        (b"Dear diary,\n", ""),
        (b"", ""),
    ],
)
def test_a_file_is_told_by_its_content(tmp_path: Path, content: bytes, kind: str) -> None:
    path = tmp_path / "a"
    path.write_bytes(content)
    assert kind_of(path).startswith(kind)
    assert kind or not kind_of(path)
    packed = tmp_path / "a.gz"
    packed.write_bytes(gzip.compress(content))
    assert kind_of(packed) == kind_of(path)


def test_what_a_mapper_saves_is_known(tmp_path: Path) -> None:
    save_map(make_mapper("odometry"), tmp_path / "a.albot")
    assert kind_of(tmp_path / "a.albot") == "a map that a mapper saved"


def test_folders_are_told_and_what_is_not_there_is_not(tmp_path: Path) -> None:
    assert kind_of(tmp_path) == "a folder"
    assert kind_of(tmp_path / "gone") == ""
