"""The error for bad input, and suggestions for misspelled names."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from functools import partial

_LONGEST = 200
"""Largest number of characters of a found value, or of its place, in a message."""
_LONGEST_SOURCE = 1000
"""Largest number of characters of the source, which may be the path of a file."""


class InputError(ValueError):
    """Invalid input from outside: a file, an option, an action.

    The message is one line that names the source, the place in it, what was expected
    and what was found: `intel.log, line 37: expected 180 ranges, found 112`.
    The command prints it and exits with status 2.

    Args:
        source: The invalid file, option or argument.
        expected: What was expected.
        found: What was found instead; empty if there is nothing to quote.
        place: Place in the source (`line 37`, `walls[3]`); empty for the whole source.
    """

    def __init__(self, source: object, expected: str, found: str = "", *, place: str = "") -> None:
        self.source = _shortened(_one_line(source), _LONGEST_SOURCE)
        self.expected = _one_line(expected)
        self.found = found = _shortened(_one_line(found))
        self.place = place = _shortened(_one_line(place))
        where = f"{self.source}, {place}" if place else self.source
        tail = f", found {self.found}" if found else ""
        super().__init__(f"{where}: expected {self.expected}{tail}")

    def __reduce__(self) -> tuple[Callable[..., InputError], tuple[str, ...]]:
        """Return what pickling needs, to send the error from worker processes."""
        return partial(InputError, place=self.place), (self.source, self.expected, self.found)


class MissingFileError(InputError):
    """The error for a missing file: `intel.log: file not found`.

    Args:
        source: The file.
    """

    def __init__(self, source: object) -> None:
        super().__init__(source, "a file that exists", "none")
        self.args = (f"{self.source}: file not found",)

    def __reduce__(self) -> tuple[Callable[..., InputError], tuple[str, ...]]:
        """Return what pickling needs, to send the error from worker processes."""
        return MissingFileError, (self.source,)


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return ` (did you mean …?)` with the most similar known name; empty if none is similar."""
    near = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.5)
    return f" (did you mean {near[0]}?)" if near else ""


def _shortened(text: str, longest: int = _LONGEST) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def _one_line(value: object) -> str:
    """Return a value as one line of text, with unprintable characters escaped."""
    return "".join(part if part.isprintable() else repr(part)[1:-1] for part in str(value))
