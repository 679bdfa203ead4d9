"""Logs as JSON, `{"map": {stamp: {"range": […], "x": …, "y": …, "theta": …}}}`.

The Intel Research Lab log is distributed in this form, with the odometer's poses and with corrected
ones; the file does not say which. Units are metres, radians and seconds; ranges run from right to
left. Entries are parsed one by one, so that a truncated file can be read up to its end.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Ranges
from albot_core.logs.log import (
    SICK_SPACINGS,
    Recording,
    Scan,
    Unread,
    read_until_damage,
    sick_laser,
)
from albot_core.logs.text import LogText

NAME = 'JSON ({"map": {stamp: {"range", "x", "y", "theta"}}})'

_ENTRY = "range (a list), x, y and theta"


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a log as JSON. With `keep_going`, read a damaged log up to the first damaged entry.

    Raises:
        InputError: An entry is damaged, and it is the first or `keep_going` is not set.
    """
    cursor = _Cursor(text)
    scans, error = read_until_damage(_scans(text, cursor), keep_going)
    if not scans:
        raise InputError(text.source, "at least one scan in the map", "none")
    return Recording(
        geometry=sick_laser(len(scans[0].ranges)),
        scans=scans,
        unread=cursor.unread(error) if error else None,
    )


def _scans(text: LogText, cursor: _Cursor) -> Iterator[Scan]:
    beams: int | None = None
    for stamp, entry in _entries(cursor):
        scan = _scan(text, stamp, entry)
        if len(scan.ranges) not in SICK_SPACINGS:
            raise text.error("180, 181, 360 or 361 ranges", str(len(scan.ranges)))
        if beams is not None and len(scan.ranges) != beams:
            raise text.error(f"{beams} ranges as in the first scan", str(len(scan.ranges)))
        beams = len(scan.ranges)
        yield scan


def _scan(text: LogText, stamp: str, entry: Any) -> Scan:
    if not isinstance(entry, dict):
        raise text.error(f"an object with {_ENTRY}", type(entry).__name__)
    missing = {"range", "x", "y", "theta"} - entry.keys()
    if missing:
        raise text.error(_ENTRY, f"no {sorted(missing)[0]}")
    pose = [_number(text, name, entry[name]) for name in ("x", "y", "theta")]
    if not isinstance(entry["range"], list):
        raise text.error(_ENTRY, f"range {entry['range']!r}")
    return Scan(
        stamp=float(text.numbers([stamp], "a stamp")[0]),
        ranges=_ranges(text, entry["range"]),
        odometry=np.array(pose),
    )


def _number(text: LogText, name: str, value: Any) -> float:
    return float(text.numbers([str(value)], name)[0])


def _ranges(text: LogText, values: list[Any]) -> Ranges:
    return text.ranges([str(value) for value in values])


def _entries(cursor: _Cursor) -> Iterator[tuple[str, Any]]:
    """Yield the members of the object "map", which may be anywhere in the outermost object."""
    for name in cursor.members():
        if name == "map":
            for stamp in cursor.members():
                yield stamp, cursor.value()
                cursor.settle()
        else:
            cursor.value()
    cursor.end()


def _finite(word: str) -> float:
    number = float(word)
    if math.isinf(number):
        raise ValueError(word)
    return number


class _Cursor:
    """A position in a JSON text, which keeps the log's line number up to date."""

    _decoder = json.JSONDecoder(parse_float=_finite)

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._content = "\n".join(text.lines)
        self._at = 0
        self._counted = 0
        self._settled = 0
        text.number = 1

    def members(self) -> Iterator[str]:
        """Yield the names in the object that begins here; read each value before the next name."""
        self._expect("{")
        if self._peek() == "}":
            self._at += 1
            return
        while True:
            name = self.value()
            if not isinstance(name, str):
                raise self._text.error("a name in quotes", repr(name))
            self._expect(":")
            yield name
            if self._peek() == "}":
                self._at += 1
                return
            self._expect(",")

    def value(self) -> Any:
        """Read the value that begins here."""
        self._peek()
        try:
            value, self._at = self._decoder.raw_decode(self._content, self._at)
        except json.JSONDecodeError as error:
            self._move_to(error.pos)
            raise self._text.error("valid JSON", error.msg) from None
        except ValueError as error:
            raise self._text.error("numbers of a common size", str(error)) from None
        except RecursionError:
            raise self._text.error("valid JSON", "brackets nested too deep") from None
        return value

    def settle(self) -> None:
        """Mark everything up to here as valid."""
        self._settled = self._at

    def unread(self, error: InputError) -> Unread:
        """Return what is lost if only the part marked by `settle` is used."""
        lost = self._content[self._settled :]
        return Unread(lines=lost.count("\n") + 1, scans=lost.count('"range"'), reason=str(error))

    def end(self) -> None:
        """Raise InputError if anything follows."""
        rest = self._peek()
        if rest:
            raise self._text.error("the end of the file", repr(rest))

    def _expect(self, mark: str) -> None:
        found = self._peek()
        if found != mark:
            raise self._text.error(repr(mark), repr(found) if found else "the end of the file")
        self._at += 1

    def _peek(self) -> str:
        """Skip white space and return the next character; "" at the end."""
        content = self._content
        while self._at < len(content) and content[self._at] in " \t\r\n":
            self._at += 1
        self._move_to(self._at)
        return content[self._at : self._at + 1]

    def _move_to(self, place: int) -> None:
        self._text.number += self._content.count("\n", self._counted, place)
        self._counted = max(self._counted, place)
