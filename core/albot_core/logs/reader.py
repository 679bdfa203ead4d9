"""Reading a robot's log in any known format, and the reference that a mapping is scored by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.tum import FIELDS, read_tum
from albot_core.files import read_beginning, read_bytes
from albot_core.logs import carmen, duke, intel_json, wean
from albot_core.logs.log import LeftOut, Log, Recording
from albot_core.logs.text import LogText, is_number


class _Format(Protocol):
    """What the module of a format of lines offers."""

    @property
    def NAME(self) -> str: ...  # noqa: N802

    @property
    def KEYWORDS(self) -> tuple[str, ...]: ...  # noqa: N802

    def read(self, text: LogText, keep_going: bool) -> Recording: ...


_LINE_FORMATS: tuple[_Format, ...] = (carmen, wean, duke)

FORMATS = (*(known.NAME for known in _LINE_FORMATS), intel_json.NAME)
"""What the known formats are called."""
_BEGINNING = 1000
"""So many characters of a text hold no zero byte; those of a picture or an archive do."""


def read_log(path: str | Path, keep_going: bool = False) -> Log:
    """Read a robot's log, in the format that its content shows.

    Files that end in `.gz` or `.xz` are unpacked. Scans come in the order of their stamps.
    Messages of other kinds are passed over.

    Args:
        path: The file.
        keep_going: Read the good beginning of a damaged log; the log's `left_out` says how
            much was lost. At least one scan must be good.

    Raises:
        InputError: The file cannot be read, is in no known format, holds no scan, or is
            damaged and not to be read as far as it is good.
    """
    path = Path(path)
    content, torn = read_beginning(path)
    if torn is not None and not (keep_going and content):
        raise torn
    recording = _read(LogText(path, content.decode("utf-8", "replace")), keep_going)
    if torn is not None:
        recording = _torn(recording, torn)
    return recording.in_time(path.name)


def _read(text: LogText, keep_going: bool) -> Recording:
    reader = _reader(text)
    if reader is None:
        expected = f"a log in one of the formats {'; '.join(FORMATS)}"
        raise InputError(text.source, expected, _kind(text))
    return reader(text, keep_going)


def _reader(text: LogText) -> Callable[[LogText, bool], Recording] | None:
    """What reads the format that the content shows; None for no known one."""
    content = "\n".join(text.lines)
    if content.lstrip().startswith("{"):
        return intel_json.read
    if "\0" in content[:_BEGINNING]:
        return None
    readers = {word: known.read for known in _LINE_FORMATS for word in known.KEYWORDS}
    words = (word for line in text.lines for word in line.split(None, 1)[:1])
    return next((readers[word] for word in words if word in readers), None)


def _kind(text: LogText) -> str:
    """What a file of no known format seems to be."""
    beginning = next((line for line in text.lines if line.strip()), "")[:40]
    if not beginning:
        return "an empty file"
    if beginning.startswith("PK\x03\x04"):
        return "a zip archive"
    return repr(beginning) if beginning.isprintable() else "binary data"


def _torn(recording: Recording, torn: InputError) -> Recording:
    """The beginning of a log that was unpacked from a torn archive."""
    lost = recording.left_out or LeftOut(lines=0, scans=0, reason="")
    return replace(recording, left_out=replace(lost, reason=str(torn)))


def read_reference(path: Path) -> Trajectory:
    """Read a reference: a TUM trajectory, a JSON log, or a CARMEN log of corrected poses.

    A JSON log's poses are taken as they are; the format does not say whose they are.

    Raises:
        InputError: The file cannot be read, or is none of these.
    """
    text = LogText(path, read_bytes(path).decode("utf-8", "replace"))
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
    """Whether the first line that is no comment begins with a number: that of no log does."""
    for line in text.lines:
        words = line.split()
        if words and not words[0].startswith("#"):
            return is_number(words[0])
    return False
