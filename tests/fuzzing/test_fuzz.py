"""The harness finds what it looks for."""

from __future__ import annotations

import json
from pathlib import Path

from albot_core.errors import InputError
from tests.fuzzing.fuzz import tally
from tests.fuzzing.readers import Reader


def _careless(folder: Path) -> None:
    """Reads JSON, and takes it for what was written."""
    try:
        content = json.loads((folder / "a.json").read_bytes())
    except (ValueError, RecursionError):
        raise InputError(folder / "a.json", "JSON", "something else") from None
    assert content["numbers"][0] + content["numbers"][1] == 3


def test_a_careless_reader_is_found_out(tmp_path: Path) -> None:
    reader = Reader(
        name="careless",
        functions=(_careless,),
        write=lambda folder: (folder / "a.json").write_text('{"numbers": [1, 2], "more": {}}'),
        read=_careless,
    )
    counts = tally(reader, tmp_path, 200, seed=1)
    assert counts.read > 5
    assert counts.refused > 5
    kinds = {name.split()[0] for name in counts.crashes}
    assert kinds >= {"TypeError", "KeyError", "AssertionError"}
    assert all(" at test_fuzz.py:" in name for name in counts.crashes)
    assert counts.read + counts.refused + sum(counts.crashes.values()) >= 200
    traceback = (tmp_path / "crash-0" / "traceback").read_text()
    assert "Traceback" in traceback
    assert (tmp_path / "crash-0" / "a.json").exists()
