"""What a file is, by its content: for errors about a file of the wrong kind."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

from albot_core.archive import CORRUPT, HEADER
from albot_core.errors import InputError
from albot_core.files import exists, read_beginning
from albot_core.logs.reader import log_format
from albot_core.ros.bag import is_bag

BAG = "a ROS bag"
_BEGINNINGS = {
    b"#ROSBAG V": BAG,
    b"SQLite format 3\0": f"{BAG} or another SQLite database",
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
    b"P5": "a picture",
    b"%PDF": "a PDF document",
}
AGENT = "the file of a trained agent"
_ARCHIVES = {
    "albot-agent": AGENT,
    "albot-map": "a map that a mapper saved",
    "albot-checkpoint": "a checkpoint of a training run",
    "albot-demonstrations": "demonstrations for a training",
}
"""The formats of archives, by the name in their header."""
_TEXTS = {
    r"^albot-world:": "a world in albot-world YAML",
    r"^image:": "the description of a ROS map",
    r"^task: *Albot/": "a training plan",
    r'^{\s*"verts"': "a HouseExpo house",
}
"""Patterns at the beginning of a line of texts."""
_BEGINNING = 1 << 16
"""So much of a text or a header is searched (characters)."""


def kind_of(path: Path) -> str:
    """Return what a file is, by its content; "" if that is unknown or it cannot be read."""
    if exists(path) and path.is_dir():
        return BAG if is_bag(path) else "a folder"
    try:
        content, _ = read_beginning(path)
    except InputError:
        return ""
    if content.startswith(b"PK\x03\x04"):
        return _archive_kind(content)
    if content.startswith(b"\x89MCAP"):
        return BAG if is_bag(path) else "a recorded episode"
    for beginning, kind in _BEGINNINGS.items():
        if content.startswith(beginning):
            return kind
    text = content.decode(errors="replace")
    for pattern, kind in _TEXTS.items():
        if re.search(pattern, text[:_BEGINNING], re.MULTILINE):
            return kind
    log = log_format(path, text)
    return "" if log is None else f"a robot's log, {log}"


def _archive_kind(content: bytes) -> str:
    """Return what a zip archive is; "" if it is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive, archive.open(HEADER) as header:
            found = re.search(rb'"format": "([a-z-]+)"', header.read(_BEGINNING))
    except CORRUPT:
        return ""
    return _ARCHIVES.get(found[1].decode() if found else "", "a zip archive")
