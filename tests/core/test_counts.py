"""Counts as text."""

from __future__ import annotations

from albot_core.counts import many


def test_one_thing_is_told_of_as_one():
    assert [many(n, "scan") for n in (0, 1, 1310)] == ["0 scans", "1 scan", "1,310 scans"]
    assert [many(n, "box", "boxes") for n in (1, 2)] == ["1 box", "2 boxes"]
