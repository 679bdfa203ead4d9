"""`albot bench`: its keys, its parts, and that a large map is really large. No test of time."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from albot_cli.main import albot
from albot_core.albot1.mapper import Albot1
from albot_core.errors import InputError
from albot_env.benchmarks import laser
from albot_env.benchmarks.mapper import copies_of, knowing, measure_mappers, tour_readings
from albot_maps import load_world


@pytest.fixture(autouse=True)
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spend little time on each case: what is measured is not what is tested."""
    monkeypatch.setattr(laser, "measure_laser", partial(laser.measure_laser, 0.05))


def bench(*args: str) -> dict[str, object]:
    outcome = CliRunner().invoke(albot, ["bench", *args, "--json"], catch_exceptions=False)
    figures: dict[str, object] = json.loads(outcome.stdout)
    return figures


def test_all_keys_stand_whatever_is_measured() -> None:
    figures = bench("--part", "laser")
    assert {"machine", "laser", "mapper", "env", "generator", "learner"} <= figures.keys()
    assert figures["mapper"] == []
    rows = figures["laser"]
    assert isinstance(rows, list)
    assert [round(row["segments"], -1) for row in rows] == [60, 200, 1000]
    assert {"segments", "us_per_scan", "ratio_to_pymunk"} <= rows[0].keys()
    assert {"processor", "cores", "python", "libraries"} <= figures["machine"].keys()  # type: ignore[attr-defined]


def test_the_text_has_a_line_a_row() -> None:
    outcome = CliRunner().invoke(albot, ["bench", "--part", "laser"], catch_exceptions=False)
    lines = outcome.stdout.splitlines()
    assert len(lines) == 4
    assert all("µs/scan" in line for line in lines[1:])


def test_mappers_are_timed_on_any_readings() -> None:
    readings = tour_readings()[:30]
    rows = measure_mappers(("albot1", "odometry"), readings, rounds=1)
    assert [row["name"] for row in rows] == ["albot1", "odometry"]
    for key in ("readings_per_second", "batch_readings_per_second", "row_readings_per_second"):
        assert all(row[key] > 0 for row in rows)  # type: ignore[operator]


def test_a_large_map_knows_the_floor_again_and_again_and_maps_on() -> None:
    floor = load_world("office-ring").walls
    walls = copies_of(floor, 1500)
    assert walls.shape == (1500, 4)
    assert np.array_equal(walls[: len(floor)], floor)
    # The copies lie apart: no two share a wall.
    assert len(np.unique(walls, axis=0)) == len(walls)
    readings = tour_readings()
    mapper = Albot1.default()
    mapper.update(readings[0])
    few = len(mapper.surfaces)
    mapper.restore(knowing(mapper.state(), walls))
    assert len(mapper.surfaces) == few + 1500
    for reading in readings[1:6]:
        mapper.update(reading)
    assert np.isfinite(mapper.pose).all()


@pytest.mark.parametrize(
    ("args", "message"),
    [(["--part", "lazer"], "one of laser"), (["--log", "missing.log"], "a file that exists")],
)
def test_bad_input_is_one_line(args: list[str], message: str, tmp_path: Path) -> None:
    outcome = CliRunner().invoke(albot, ["bench", *args])
    assert isinstance(outcome.exception, InputError)
    assert message in str(outcome.exception)
