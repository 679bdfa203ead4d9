"""Reading the reference that a log's mapping is held against."""

from __future__ import annotations

from pathlib import Path

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.tum import read_tum
from albot_core.files import read_bytes
from albot_core.logs.reader import read_log
from albot_core.logs.text import LogText, is_number


def read_reference(path: Path) -> Trajectory:
    """Read a reference: a TUM trajectory, a JSON log, or a CARMEN log of corrected poses.

    A JSON log's poses are taken as they are; the format does not say whose they are.

    Raises:
        InputError: The file cannot be read, or is none of these.
    """
    text = LogText(path, read_bytes(path).decode("utf-8", "replace"))
    if _is_tum(text):
        return read_tum(text)
    log = read_log(path)
    if log.reference_trajectory is not None:
        return log.reference_trajectory
    if "\n".join(text.lines).lstrip().startswith("{"):
        return log.odometry_trajectory
    raise InputError(path, "a log that holds corrected poses", "only odometry")


def _is_tum(text: LogText) -> bool:
    """Whether the first line that is no comment consists of eight fields, the first a number."""
    for line in text.lines:
        words = line.split()
        if words and not words[0].startswith("#"):
            return len(words) == 8 and is_number(words[0])
    return False
