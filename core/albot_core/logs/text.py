"""A log's text, read record by record by a reader that knows where it is."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.logs.log import SICK_SPACINGS, LeftOut
from albot_core.plain_data import LARGEST

_LONGEST_COUNT = 9
"""Digits in a number of things."""


class LogText:
    """The lines of a log, and the number of the one being read.

    Args:
        source: The file that errors name.
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
        """The words of every line that begins with a keyword; other lines are passed over.

        Some programs write no newline after the last line, so that alone is no sign of a
        torn one. Too few words are, which is for the caller to check.

        Args:
            keywords: What the lines of interest begin with.
            fixed_end: Whether their last words are numbers of as many decimals each, so
                that fewer in the last line show that it is torn. The first line of its kind
                is held against the lines of other kinds, and the word before its last.

        Raises:
            InputError: The last line is torn within its keyword or its last number.
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
                    raise self.error("a whole number at the end", repr(words[-1]))
                decimals[words[0]] = _decimals(words[-1])
                yield words
            elif may_be_torn and any(keyword.startswith(words[0]) for keyword in keywords):
                raise self.error("a whole line", repr(line))

    def error(self, expected: str, found: str) -> InputError:
        """The error that names the line being read."""
        return InputError(self.source, expected, found, place=f"line {self.number}")

    def left_out(self, scan_keywords: Collection[str], error: InputError) -> LeftOut:
        """What is lost when reading ends at this line because of `error`."""
        rest = self.lines[self.number - 1 :]
        scans = sum(word in scan_keywords for line in rest for word in line.split(None, 1)[:1])
        return LeftOut(lines=len(rest), scans=scans, reason=str(error))

    def numbers(self, words: Sequence[str], what: str) -> Float64[np.ndarray, "numbers"]:
        """The words as finite numbers, small enough to reckon with.

        Raises:
            InputError: One is no number, or is none within `LARGEST`.
        """
        values = self._parse(words, what)
        good = np.abs(values) <= LARGEST
        if not good.all():
            raise self.error(f"{what} within ±{LARGEST:g}", words[int(good.argmin())])
        return values

    def ranges(self, words: Sequence[str]) -> Float64[np.ndarray, "ranges"]:
        """The words as distances: numbers not below 0, infinity among them.

        Raises:
            InputError: One is no distance, or a number too large to be one.
        """
        values = self._parse(words, "a range")
        for k in np.flatnonzero(np.isinf(values)).tolist():
            if "inf" not in words[k].lower():
                raise self.error("a range, or inf where nothing came back", words[k])
        if not (values >= 0).all():
            raise self.error("distances, numbers not below 0", words[int((values >= 0).argmin())])
        return values

    def count(self, word: str, what: str) -> int:
        """The word as a whole number of things.

        Raises:
            InputError: It is none.
        """
        if not (word.isascii() and word.isdecimal() and len(word) <= _LONGEST_COUNT):
            raise self.error(f"the number of {what}", repr(word))
        return int(word)

    def beams(self, words: Sequence[str], first: int | None) -> int:
        """The number of beams of a SICK laser's scan, told by the only one of `words`.

        Args:
            words: The field that tells it; none where the line is too short.
            first: The number in the first scan; None where this is the first.

        Raises:
            InputError: No such laser is known, or the first scan had another number.
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
    """Number of characters after the point."""
    return len(word.partition(".")[2])


def is_number(word: str) -> bool:
    """Whether a word is a number, NaN and infinity among them."""
    try:
        float(word)
    except ValueError:
        return False
    return True
