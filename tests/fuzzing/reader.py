"""Something that reads files, as the tests see it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Reader:
    """Something that reads files."""

    name: str
    """What it is called in tests and on the page."""
    functions: Sequence[Callable[..., Any]]
    """The public functions that are tried by it."""
    write: Callable[[Path], object]
    """Writes whole files of its kind into a folder."""
    read: Callable[[Path], object]
    """Reads them, and uses what was read."""
    examples: int = 20
    """Damaged inputs in a run of the tests."""


def one_file(
    name: str,
    file: str,
    content: str | bytes,
    read: Callable[[Path], object],
    *functions: Callable[..., Any],
) -> Reader:
    """A reader of one file, which has this content."""
    data = content.encode() if isinstance(content, str) else content
    return Reader(
        name=name,
        functions=functions,
        write=lambda folder: (folder / file).write_bytes(data),
        read=lambda folder: read(folder / file),
    )
