"""The error comes whole out of another process."""

from __future__ import annotations

import copy

from albot_core.errors import InputError, MissingFileError


def test_a_copy_says_the_same() -> None:
    error = InputError("intel.log", "180 ranges", "112", place="line 37")
    twin = copy.copy(error)  # By `__reduce__`, as what goes between processes.
    assert isinstance(twin, InputError)
    assert str(twin) == str(error) == "intel.log, line 37: expected 180 ranges, found 112"
    assert vars(twin) == vars(error)


def test_a_missing_file_is_said_to_be_not_found() -> None:
    error = MissingFileError("intel.log")
    twin = copy.copy(error)
    assert isinstance(twin, MissingFileError)
    assert str(twin) == str(error) == "intel.log: file not found"
    for each in (error, twin):
        assert (each.expected, each.found) == ("a file that exists", "none")


def test_what_was_found_is_quoted_in_short() -> None:
    error = InputError("a", "a number", "9" * 5000, place="x" * 5000)
    assert len(str(error)) < 500
    assert str(error).endswith("99…")


def test_it_is_one_line_whatever_was_found() -> None:
    error = InputError("a\nb.log", "a name", "x\r\ny\x1b[2J é", place="line\t3")
    assert str(error) == r"a\nb.log, line\t3: expected a name, found x\r\ny\x1b[2J é"
