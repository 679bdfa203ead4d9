"""The text of a log, read record by record, with line numbers for errors."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.logs.log import SICK_SPACINGS, Unread
from albot_core.plain_data import LARGEST

_MOST_PLACES = 10
"""Largest number of places that a report on damage lists."""
_LONGEST_COUNT = 9
"""Largest number of digits of a count."""


Words = TypeVar("Words")
Record = TypeVar("Record")


class Extent(NamedTuple):
    """The lines of a record."""

    first: int
    """Number of the first one."""
    lines: int
    """How many there are."""
    scans: int
    """Number of scans that begin in them."""


class LogText:
    """The lines of a log, and the number of the current line.

    Args:
        source: The file, for errors.
        text: Its content.
    """

    def __init__(self, source: Path, text: str) -> None:
        self.source = source
        self.lines = text.split("\n")
        self.number = 0
        self.damage: InputError | None = None
        """The error of the first record that `parse` left out; None if it left out none."""
        self._bad: list[Extent] = []
        self._last_line_torn = bool(self.lines[-1])
        if not self.lines[-1]:
            self.lines.pop()

    def records(self, keywords: Collection[str], fixed_end: bool = False) -> Iterator[list[str]]:
        """Yield the words of every line that begins with a keyword; other lines are skipped.

        Some programs write no newline after the last line, so a missing newline alone does not mean
        that the line is truncated. Too few words do; the caller must check their number.

        Args:
            keywords: The first words of the lines to yield.
            fixed_end: Whether the last words of these lines are numbers with the same number of
                decimals, so that fewer decimals in the last line mean that it is truncated. The
                first line of a kind is compared with lines of other kinds and with its last but
                one word.

        Raises:
            InputError: The last line is truncated in its keyword or its last number.
        """
        decimals: dict[str, int] = {}
        for number, line in enumerate(self.lines, start=1):
            self.number = number
            words = line.split()
            if not words:
                continue
            may_be_torn = self._last_line_torn and number == len(self.lines)
            if words[0] in keywords:
                others = max((*decimals.values(), *map(_decimals, words[-2:-1])), default=0)
                usual = decimals.get(words[0], others)
                if fixed_end and may_be_torn and _decimals(words[-1]) < usual:
                    raise self.error("a complete number at the end", repr(words[-1]))
                decimals[words[0]] = _decimals(words[-1])
                yield words
            elif may_be_torn and any(keyword.startswith(words[0]) for keyword in keywords):
                raise self.error("a complete line", repr(line))

    def error(self, expected: str, found: str) -> InputError:
        """Return an error that names the current line."""
        return InputError(self.source, expected, found, place=f"line {self.number}")

    def parse(
        self,
        records: Iterator[Words],
        parse: Callable[[Words], Record | None],
        keep_going: bool,
        scan_keywords: Collection[str] | None = None,
        extent: Callable[[], Extent] | None = None,
    ) -> list[Record]:
        """Return what is parsed of each record; with `keep_going`, bad ones are left out.

        Args:
            records: The records, from the methods of this text.
            parse: Parses a record; returns None for one that is not needed.
            keep_going: Whether to leave out bad records; `unread` says which.
            scan_keywords: First words of the lines that are scans; None if every line is one.
            extent: Returns the lines of the bad record; by default the current line.

        Raises:
            InputError: A record is bad, and `keep_going` is not set.
        """
        good: list[Record] = []
        while True:
            try:
                record = next(records, None)
                if record is None:
                    return good
                parsed = parse(record)
            except InputError as error:
                if not keep_going:
                    raise
                self.damage = self.damage or error
                self._bad.append(extent() if extent else self._line_extent(scan_keywords))
            else:
                good += [] if parsed is None else [parsed]

    @property
    def unread(self) -> Unread | None:
        """What `parse` left out; None if nothing."""
        if self.damage is None:
            return None
        return Unread(
            lines=sum(bad.lines for bad in self._bad),
            scans=sum(bad.scans for bad in self._bad),
            where=_where(self._bad),
            reason=str(self.damage),
        )

    def _line_extent(self, scan_keywords: Collection[str] | None) -> Extent:
        word = self.lines[self.number - 1].split(None, 1)[0]
        return Extent(self.number, 1, int(scan_keywords is None or word in scan_keywords))

    def numbers(self, words: Sequence[str], what: str) -> Float64[np.ndarray, "numbers"]:
        """Parse words as finite numbers; `what` names them in errors.

        Raises:
            InputError: A word is not a number within ±`LARGEST`.
        """
        values = self._parse(words, what)
        good = np.abs(values) <= LARGEST
        if not good.all():
            raise self.error(f"{what} within ±{LARGEST:g}", words[int(good.argmin())])
        return values

    def ranges(self, words: Sequence[str]) -> Float64[np.ndarray, "ranges"]:
        """Parse words as distances: numbers from 0, or infinity.

        Raises:
            InputError: A word is not a distance, or is a number that overflows to infinity.
        """
        values = self._parse(words, "a range")
        for k in np.flatnonzero(np.isinf(values)).tolist():
            if "inf" not in words[k].lower():
                raise self.error("a range, or inf for no return", words[k])
        if not (values >= 0).all():
            raise self.error("ranges of 0 or more", words[int((values >= 0).argmin())])
        return values

    def count(self, word: str, what: str) -> int:
        """Parse a word as a count; `what` names it in errors.

        Raises:
            InputError: The word is not a count, or has more than `_LONGEST_COUNT` digits.
        """
        if not (word.isascii() and word.isdecimal() and len(word) <= _LONGEST_COUNT):
            raise self.error(f"the number of {what}", repr(word))
        return int(word)

    def beams(self, words: Sequence[str], first: int | None) -> int:
        """Parse the number of beams of a SICK laser's scan.

        Args:
            words: A list of the one word with the number; empty if the line is too short.
            first: The number in the first scan; None if this is the first.

        Raises:
            InputError: No SICK laser has this number, or the first scan had another one.
        """
        beams = self.count(words[0], "beams") if words else 0
        if first is not None and beams != first:
            raise self.error(f"{first} beams as in the first scan", str(beams))
        if beams not in SICK_SPACINGS:
            raise self.error("180, 181, 360 or 361 beams", str(beams))
        return beams

    def _parse(self, words: Sequence[str], what: str) -> Float64[np.ndarray, "numbers"]:
        try:
            return np.array([float(word) for word in words], dtype=np.float64)
        except ValueError:
            bad = next(word for word in words if not is_number(word))
            raise self.error(f"{what} that is a number", repr(bad)) from None


def _where(bad: Sequence[Extent]) -> str:
    """Return the numbers of the lines of bad records, successive ones as a range."""
    runs: list[list[int]] = []
    for first, count, _ in bad:
        if runs and first <= runs[-1][1] + 1:
            runs[-1][1] = max(runs[-1][1], first + count - 1)
        else:
            runs.append([first, first + count - 1])
    texts = [f"{first} to {last}" if last > first else f"{first}" for first, last in runs]
    more = [f"{len(texts) - _MOST_PLACES} more places"] if len(texts) > _MOST_PLACES else []
    is_one = len(runs) == 1 and runs[0][0] == runs[0][1]
    return f"{'line' if is_one else 'lines'} {', '.join(texts[:_MOST_PLACES] + more)}"


def _decimals(word: str) -> int:
    """Return the number of characters after the decimal point."""
    return len(word.partition(".")[2])


def is_number(word: str) -> bool:
    """Return whether a word is a number, including NaN and infinity."""
    try:
        float(word)
    except ValueError:
        return False
    return True
