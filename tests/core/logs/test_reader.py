"""What a file is that is no log."""

from __future__ import annotations

from pathlib import Path

import pytest

from albot_core.errors import InputError
from albot_core.logs.reader import read_log, read_reference


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ("", "an empty file"),
        ("\n \n", "an empty file"),
        ("\nDear diary,\n", "'Dear diary,'"),
        ("PK\x03\x04", "a zip archive"),
        ("\x01\x02", "binary data"),
        ("loop 3 1 0.9", "a line of libRSF"),
    ],
)
def test_the_error_says_what_it_is(tmp_path: Path, content: str, found: str) -> None:
    (tmp_path / "a.log").write_text(content)
    for read in (read_log, read_reference):
        with pytest.raises(InputError) as caught:
            read(tmp_path / "a.log")
        assert caught.value.found.startswith(found)
