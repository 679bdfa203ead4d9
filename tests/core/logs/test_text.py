"""What is left out of a log whose damaged lines are skipped."""

from __future__ import annotations

from pathlib import Path

import pytest

from albot_core.errors import InputError
from albot_core.logs.text import LogText


def _parsed(lines: list[str], keep_going: bool = True) -> tuple[LogText, list[int]]:
    text = LogText(Path("a.log"), "\n".join(lines) + "\n")

    def parse(words: list[str]) -> int | None:
        number = int(text.numbers(words[1:], "a number")[0])
        return number if words[0] == "SCAN" else None

    return text, text.parse(text.records(("SCAN", "POSE")), parse, keep_going, ("SCAN",))


def test_bad_lines_are_left_out_and_told() -> None:
    lines = ["POSE x", "SCAN 1", "NOTE x", "SCAN y", "SCAN z", "POSE 2", "SCAN 2", "SCAN w"]
    text, good = _parsed(lines)
    assert good == [1, 2]
    unread = text.unread
    assert unread is not None
    assert (unread.lines, unread.scans, unread.where) == (4, 3, "lines 1, 4 to 5, 8")
    assert unread.reason == "a.log, line 1: expected a number that is a number, found 'x'"
    with pytest.raises(InputError, match="line 1: "):
        _parsed(lines, keep_going=False)
    text, good = _parsed(lines[5:7])
    assert (good, text.unread) == ([2], None)


def test_a_few_of_many_places_are_told() -> None:
    text, _ = _parsed(["SCAN x", "SCAN 1"] * 12)
    assert text.unread is not None
    assert text.unread.where.startswith("lines 1, 3, 5, ")
    assert text.unread.where.endswith("17, 19, 2 more places")
