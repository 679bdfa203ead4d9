"""Read a robot's log in any known format, and the reference trajectory for scoring a mapper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.tum import FIELDS, read_tum
from albot_core.files import decode_text, read_beginning, read_text
from albot_core.logs import carmen, duke, intel_json, mines, ros_bag, wean
from albot_core.logs.log import Log, Recording, Unread
from albot_core.logs.ros_bag import BagTopics
from albot_core.logs.text import LogText, is_number
from albot_core.ros.bag import METADATA, is_bag


class _Format(Protocol):
    """The members of a module that reads a line-based format."""

    @property
    def NAME(self) -> str: ...  # noqa: N802

    @property
    def KEYWORDS(self) -> tuple[str, ...]: ...  # noqa: N802

    def read(self, text: LogText, keep_going: bool) -> Recording: ...


_LINE_FORMATS: tuple[_Format, ...] = (carmen, wean, duke)

FORMATS = (*(known.NAME for known in _LINE_FORMATS), intel_json.NAME, mines.NAME, ros_bag.NAME)
"""Names of the known formats."""
_LIBRSF = ("odom2", "loop", "point2", "angle")
"""First words of lines in the data sets of TU Chemnitz's libRSF."""
_BEGINNING = 1000
"""Number of characters checked for a zero byte, which means that the file is not text."""


def read_log(path: str | Path, keep_going: bool = False, topics: BagTopics | None = None) -> Log:
    """Read a robot's log; its content determines the format.

    A bag of ROS is a log, too (see `read_ros_bag`), and is read as a whole or not at all. Of the
    other formats, files that end in `.gz` or `.xz` are unpacked. Scans are in the order of time
    (see `Recording.to_log`). Messages of other kinds are skipped.

    Args:
        path: The file.
        keep_going: Whether to leave out the damaged lines of a log; the log's `unread` says
            which. At least one scan must be good.
        topics: The topics of a bag that are read.

    Raises:
        InputError: The file cannot be read, has no known format, holds no scan, or is damaged
            and `keep_going` is not set; or topics of what is no bag are asked for.
    """
    path = Path(path)
    if is_bag(path):
        return ros_bag.read_ros_bag(path, topics)
    if path.is_dir():
        raise InputError(path, f"a log, or a ROS bag with {METADATA}", "a folder without it")
    content, damage = read_beginning(path)
    if damage is not None and not (keep_going and content):
        raise damage
    text = LogText(path, decode_text(content, path, "replace"))
    if topics is not None:
        raise InputError(path, "a ROS bag, as topics are given", _kind(text))
    recording = _read(text, keep_going)
    if damage is not None:
        recording = _damaged(recording, damage)
    return recording.to_log(path.name)


def _read(text: LogText, keep_going: bool) -> Recording:
    reader = _reader(text)
    if reader is None:
        expected = f"a log in one of the formats {'; '.join(FORMATS)}"
        raise InputError(text.source, expected, _kind(text))
    return reader(text, keep_going)


def log_format(path: Path, text: str) -> str | None:
    """Return the name of the format of a log's text; None for a text that is no log."""
    log = LogText(path, text)
    reader = _reader(log)
    if reader is intel_json.read and '"theta"' not in text:
        return None  # Any other JSON.
    named: dict[Any, str] = {known.read: known.NAME for known in _LINE_FORMATS}
    named |= {intel_json.read: intel_json.NAME, mines.read: mines.NAME}
    return None if reader is None else named[reader]


def _reader(text: LogText) -> Callable[[LogText, bool], Recording] | None:
    """Return the reader for the content's format; None if the format is unknown."""
    content = "\n".join(text.lines)
    if content.lstrip().startswith("{"):
        return intel_json.read
    if "\0" in content[:_BEGINNING]:
        return None
    first = next((line for line in text.lines if line.strip() and line.lstrip()[0] != "#"), "")
    if mines.is_mines(first):
        return mines.read
    readers = {word: known.read for known in _LINE_FORMATS for word in known.KEYWORDS}
    words = (word for line in text.lines for word in line.split(None, 1)[:1])
    return next((readers[word] for word in words if word in readers), None)


def _kind(text: LogText) -> str:
    """Return a description of a file of unknown format, for the error."""
    beginning = next((line.strip() for line in text.lines if line.strip()), "")[:40]
    if not beginning:
        return "an empty file"
    if beginning.startswith("PK\x03\x04"):
        return "a zip archive"
    if beginning.split()[0] in _LIBRSF:
        return (
            f"a line of libRSF, {beginning.split()[0]}, which holds neither scans nor sonars; "
            "convert its sensor data to FLASER lines, and its truth to a TUM trajectory"
        )
    from albot_core.file_kinds import kind_of  # It imports this module.

    return kind_of(text.source) or (repr(beginning) if beginning.isprintable() else "binary data")


def _damaged(recording: Recording, damage: InputError) -> Recording:
    """Return a recording from a damaged archive, with the archive's error in `unread`."""
    lost = recording.unread or Unread(lines=0, scans=0, where="", reason="")
    return replace(recording, unread=replace(lost, reason=str(damage)))


def read_reference(path: Path) -> Trajectory:
    """Read a reference: a TUM trajectory, a JSON log, or a CARMEN log of corrected poses.

    The poses of a JSON log are taken as the reference; the format does not say what they are.

    Raises:
        InputError: The file cannot be read, or is none of these.
    """
    text = LogText(path, read_text(path, errors="replace"))
    if path.suffix == ".tum" or _is_tum(text):
        return read_tum(text)
    if _reader(text) is None:
        expected = f"a TUM trajectory ({FIELDS}), a JSON log, or a CARMEN log of corrected poses"
        raise InputError(path, expected, _kind(text))
    log = read_log(path)
    if log.reference_trajectory is not None:
        return log.reference_trajectory
    if "\n".join(text.lines).lstrip().startswith("{"):
        return log.odometry_trajectory
    raise InputError(path, "a log that holds corrected poses", "only odometry")


def _is_tum(text: LogText) -> bool:
    """Return whether the first line that is not a comment begins with a number, and is no scan."""
    for line in text.lines:
        words = line.split()
        if words and not words[0].startswith("#"):
            return is_number(words[0]) and not mines.is_mines(line)
    return False
