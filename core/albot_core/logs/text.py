"""The text of a log, read record by record, with line numbers for errors."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.logs.log import SICK_SPACINGS, Unread
from albot_core.plain_data import LARGEST

_LONGEST_COUNT = 9
"""Largest number of digits of a count."""


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

    def unread(self, scan_keywords: Collection[str], error: InputError) -> Unread:
        """Return what is lost if reading ends at the current line because of `error`."""
        rest = self.lines[self.number - 1 :]
        scans = sum(word in scan_keywords for line in rest for word in line.split(None, 1)[:1])
        return Unread(lines=len(rest), scans=scans, reason=str(error))

    def unread_lines(self, error: InputError) -> Unread:
        """Return the same of a log whose lines are a scan each."""
        rest = self.lines[self.number - 1 :]
        scans = sum(bool(line.split()) for line in rest)
        return Unread(lines=len(rest), scans=scans, reason=str(error))

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
