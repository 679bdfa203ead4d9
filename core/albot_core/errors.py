"""The error that bad input raises, and how it names what may have been meant."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from functools import partial

_LONGEST = 200
"""Characters of what was found, and of its place, that errors quote…"""
_LONGEST_SOURCE = 1000
"""…and of the source, which may be the path of a file."""


class InputError(ValueError):
    """Input from outside (a file, an option, an action) that cannot be used.

    The message is one line that names the source, the place in it, what was expected
    and what was found: `intel.log, line 37: expected 180 ranges, found 112`.
    The command prints it and exits with status 2.

    Args:
        source: The file, option or argument that is wrong.
        expected: What should have stood there.
        found: What stood there instead; empty where there is nothing to quote.
        place: Where in the source (`line 37`, `walls[3]`); empty where the whole is meant.
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
        """What worker processes send of it."""
        return partial(InputError, place=self.place), (self.source, self.expected, self.found)


class MissingFileError(InputError):
    """The error where there is no file of the name given: `intel.log: file not found`.

    Args:
        source: The file.
    """

    def __init__(self, source: object) -> None:
        super().__init__(source, "a file that exists", "none")
        self.args = (f"{self.source}: file not found",)

    def __reduce__(self) -> tuple[Callable[..., InputError], tuple[str, ...]]:
        """What worker processes send of it."""
        return MissingFileError, (self.source,)


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """` (did you mean …?)` with the known name nearest to this one; empty where none is near."""
    near = difflib.get_close_matches(str(name), list(known), n=1, cutoff=0.5)
    return f" (did you mean {near[0]}?)" if near else ""


def _shortened(text: str, longest: int = _LONGEST) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def _one_line(told: object) -> str:
    """As text, in which nothing begins a new line."""
    return "".join(part if part.isprintable() else repr(part)[1:-1] for part in str(told))
