"""Counts as text."""

from __future__ import annotations


def many(count: int, thing: str, things: str = "") -> str:
    """Return a number of things, as `1 scan` or `1,310 scans`.

    Args:
        count: The number.
        thing: What one is called.
        things: What several are called; empty for `thing` with an s.
    """
    return f"{count:,} {thing if count == 1 else things or f'{thing}s'}"
