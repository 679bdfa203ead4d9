"""The long journey's page: its table, its picture, and how fast things grow."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner

from albot_benchmarks import long_run as journey
from albot_cli.group import albot
from albot_cli.long_run_page import page
from albot_core.errors import InputError

MACHINE = {"processor": "a processor", "python": "3.12"}


def row(km: float, **others: float | str) -> dict[str, float | str]:
    names = "us_per_reading", "ratio", "surfaces", "places", "exits", "described", "visits"
    names += "events", "trail_points", "trail_links", "memory_bytes", "readings"
    zeros: dict[str, float | str] = dict.fromkeys(names, 0)
    return zeros | {"name": "albot1", "world": "a house", "path_km": km} | others


def test_what_grows_in_the_second_half_is_told_by_the_kilometre() -> None:
    rows = [
        row(k, ratio=2.0, memory_bytes=1024 * (50 * k if k > 4 else 7), places=3 * k)
        for k in range(1, 9)
    ]
    text = page(rows, MACHINE, "picture.png")
    assert (
        "a kilometre more adds +0.0 % to the ratio, +50.0 KiB, +3.0 places, +0.0 surfaces" in text
    )
    assert "| 8.0 | 0 | 2.00 | 400 | 0 | 24 | 0 | 0 | 0 | 0 | 0 | 0 |" in text.splitlines()
    assert "![Cost and memory along the way](picture.png)" in text


def test_of_a_short_journey_no_growth_is_told() -> None:
    assert "second half" not in page([row(1.0), row(2.0)], MACHINE, "picture.png")


def test_the_command_writes_the_page_and_its_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = partial(journey.measure_long_run, 10.0, 5.0, world="office-ring")
    monkeypatch.setattr(journey, "measure_long_run", short)
    out = tmp_path / "journey.md"
    words = ["bench", "--part", "journey", "--out", str(out), "--json"]
    outcome = CliRunner().invoke(albot, words, catch_exceptions=False)
    rows = json.loads(outcome.stdout)["journey"]
    assert [line.split()[1] for line in out.read_text().splitlines()[-4:-2]] == ["0.0", "0.0"]
    assert len(rows) == 2
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_a_page_that_cannot_be_written_is_told_before_anything_is_measured(tmp_path: Path) -> None:
    outcome = CliRunner().invoke(
        albot, ["bench", "--part", "journey", "--out", str(tmp_path / "gone" / "a.md")]
    )
    assert isinstance(outcome.exception, InputError)
