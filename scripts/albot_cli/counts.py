"""Counts as text."""

from __future__ import annotations


def many(count: int, thing: str) -> str:
    """Return a number of things, as `1 scan` or `1,310 scans`."""
    return f"{count:,} {thing}" + ("" if count == 1 else "s")
