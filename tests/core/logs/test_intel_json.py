"""Logs as JSON: where the damage is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from albot_core.errors import InputError
from albot_core.logs.intel_json import read
from albot_core.logs.text import LogText

SCANS = {f"{k}.5": {"x": k, "y": 0, "theta": 0, "range": [1.0] * 180} for k in range(4)}
LINES = json.dumps({"map": SCANS}, indent=0).split("\n")
HEADINGS = [number for number, line in enumerate(LINES, start=1) if "theta" in line]


@pytest.mark.parametrize("scan", [0, 1, 3])
@pytest.mark.parametrize(
    ("wrong", "back"),
    [
        ('"theta": ,', 0),
        ('"theta" 0,', 0),
        ('"theta": 1e999,', 3),  # Its scan is named, which begins three lines before.
    ],
)
def test_the_line_of_a_damage_is_told(scan: int, wrong: str, back: int) -> None:
    number = HEADINGS[scan]
    lines = [*LINES[: number - 1], wrong, *LINES[number:]]
    with pytest.raises(InputError) as caught:
        read(LogText(Path("a.json"), "\n".join(lines)), False)
    assert caught.value.place == f"line {number - back}"
