"""What is lost of a log that is read up to a damaged line."""

from __future__ import annotations

from pathlib import Path

from albot_core.logs.text import LogText


def test_what_is_unread_begins_with_the_damaged_line() -> None:
    text = LogText(Path("a.log"), "SCAN 1\nNOTE\nSCAN x\nNOTE\n\nSCAN 4\n")
    damaged = next(words for words in text.records(("SCAN",)) if words[1] == "x")
    error = text.error("a number", damaged[1])
    assert str(error) == "a.log, line 3: expected a number, found x"
    unread = text.unread(("SCAN",), error)
    assert (unread.lines, unread.scans, unread.reason) == (4, 2, str(error))
    # Where each line that is not empty is a scan.
    unread = text.unread_lines(error)
    assert (unread.lines, unread.scans, unread.reason) == (4, 3, str(error))
