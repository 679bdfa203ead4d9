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
    sick_laser,
)
from albot_core.logs.text import Extent, LogText

NAME = 'JSON ({"map": {stamp: {"range", "x", "y", "theta"}}})'

_ENTRY = "range (a list), x, y and theta"


def read(text: LogText, keep_going: bool) -> Recording:
    """Read a log as JSON. With `keep_going`, leave out damaged entries.

    What follows a place that is not JSON is left out, too.

    Raises:
        InputError: An entry is damaged and `keep_going` is not set, or no scan is good.
    """
    cursor = _Cursor(text)
    entries = _Entries(text)
    scans = text.parse(_entries(cursor), entries.parse, keep_going, extent=cursor.extent)
    if not scans:
        raise text.damage or InputError(text.source, "at least one scan in the map", "none")
    return Recording(
        geometry=sick_laser(len(scans[0].ranges)),
        scans=scans,
        unread=text.unread,
    )


class _Entries:
    """The entries of a log, and the number of ranges of the first one."""

    def __init__(self, text: LogText) -> None:
        self._text = text
        self._beams: int | None = None

    def parse(self, entry: tuple[str, Any]) -> Scan:
        """Return the scan of a stamp and its value."""
        text, beams = self._text, self._beams
        scan = _scan(text, *entry)
        if len(scan.ranges) not in SICK_SPACINGS:
            raise text.error("180, 181, 360 or 361 ranges", str(len(scan.ranges)))
        if beams is not None and len(scan.ranges) != beams:
            raise text.error(f"{beams} ranges as in the first scan", str(len(scan.ranges)))
        self._beams = len(scan.ranges)
        return scan


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
    try:
        for name in cursor.members():
            if name == "map":
                for stamp in cursor.members():
                    yield stamp, cursor.value()
                    cursor.settle()
            else:
                cursor.value()
        cursor.end()
    except InputError:
        cursor.give_up()
        raise


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
        """Mark everything up to here as used."""
        self._settled = self._at

    def give_up(self) -> None:
        """Go to the end of the text: nothing more can be read."""
        self._at = len(self._content)

    def extent(self) -> Extent:
        """Return the lines from the last call of `settle` up to here."""
        lost = self._content[self._settled : self._at]
        begin = self._settled + len(lost) - len(lost.lstrip(", \t\r\n"))
        lost = self._content[begin : self._at]
        first = self._content.count("\n", 0, begin) + 1
        return Extent(first, lost.count("\n") + 1, lost.count('"range"'))

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
