"""`albot bench`: its keys, its parts, and that a large map is really large. No test of time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from albot_benchmarks import environment, laser, learner, mapper, painting, ratslam, slam
from albot_benchmarks import environment as processes
from albot_benchmarks.albot0 import measure_splitting
from albot_benchmarks.environment import Case
from albot_benchmarks.mapper import (
    copies_of,
    measure_looping,
    measure_mappers,
    tour_readings,
    with_surfaces,
)
from albot_benchmarks.ratslam import measure_ratslam
from albot_cli.bench import as_text
from albot_cli.group import albot
from albot_core.errors import InputError
from albot_core.mappers.registry import make_mapper
from albot_maps import load_world


@pytest.fixture(autouse=True, scope="module")
def hurried() -> Iterator[None]:
    """Spend little time on each case: what is measured is not what is tested."""
    patch = pytest.MonkeyPatch()
    patch.setattr(mapper, "_BATCH", 8)
    patch.setattr(ratslam, "_BATCH", 4)
    tiny = Case(mapper="none", num_envs=2, steps=4)
    for module, name, arguments in (
        (laser, "measure_laser", {"seconds_per_case": 0.05}),
        (environment, "measure_environments", {"cases": (tiny, Case(mapper="odometry", steps=3))}),
        (processes, "measure_processes", {"case": tiny, "seconds": 0.05}),
        (learner, "measure_learner", {"num_envs": 4, "steps": 2}),
        (painting, "measure_painting", {"mappers": ("odometry",), "steps": 3}),
    ):
        rounds = "rollouts" if module is learner else "rounds"
        if module is not laser:
            arguments |= {rounds: 1}
        patch.setattr(module, name, partial(getattr(module, name), **arguments))
    yield
    patch.undo()


@pytest.fixture(scope="module")
def laser_alone(hurried: None) -> dict[str, object]:
    """The figures of the laser's part, for those that look at another part's text."""
    return bench("--part", "laser")


def bench(*args: str) -> dict[str, object]:
    outcome = CliRunner().invoke(albot, ["bench", *args, "--json"], catch_exceptions=False)
    figures: dict[str, object] = json.loads(outcome.stdout)
    return figures


def test_all_keys_stand_whatever_is_measured(laser_alone: dict[str, object]) -> None:
    figures: Any = laser_alone
    assert {"machine", "laser", "mapper", "env", "generator", "learner"} <= figures.keys()
    assert figures["mapper"] == []
    rows = figures["laser"]
    assert isinstance(rows, list)
    assert [round(row["segments"], -1) for row in rows] == [60, 200, 1000]
    assert {"segments", "us_per_scan", "ratio_to_pymunk"} <= rows[0].keys()
    assert {"processor", "cores", "python", "libraries"} <= figures["machine"].keys()


def test_the_text_has_a_line_a_row() -> None:
    outcome = CliRunner().invoke(albot, ["bench", "--part", "laser"], catch_exceptions=False)
    lines = outcome.stdout.splitlines()
    assert len(lines) == 4
    assert all("µs/scan" in line for line in lines[1:])


def test_environments_processes_and_learner_have_their_keys_and_lines() -> None:
    words = [word for part in ("env", "processes", "learner") for word in ("--part", part)]
    figures: Any = bench(*words, "--rounds", "1")
    rows = figures["env"]
    assert isinstance(rows, list)
    keys = {
        "id",
        "mode",
        "num_envs",
        "threads",
        "mapper",
        "parts",
        "steps_per_second",
        "steps_per_cpu_second",
    }
    keys |= {"segments", "ratio"}
    assert all(keys <= row.keys() for row in rows)
    pair = figures["processes"]
    assert (pair["num_envs"], pair["processes"]) == (2, 2)
    assert pair["scaling"] == pytest.approx(pair["together"] / pair["single"])
    assert min(pair["single"], pair["scaling"], pair["scaling_cpu"]) > 0
    assert len(figures["learner"]["runs"]) == 7
    lines = as_text(figures).splitlines()
    starts = [line.split()[0] for line in lines[1:]]
    assert starts == ["environment"] * len(rows) + ["processes"] + ["learner"] * 7
    assert lines[0].startswith(f"{figures['machine']['processor']}, Python")


def test_pictures_have_their_keys_and_lines() -> None:
    figures: Any = bench("--part", "painting")
    (row,) = figures["painting"]
    assert (row["mapper"], row["width"], row["height"]) == ("odometry", 800, 600)
    assert min(row["frames_per_second"], row["frames_per_cpu_second"]) > 0
    assert row["ratio"] > 1  # An empty picture takes no longer.
    row |= {"frames_per_second": 240.2, "frames_per_cpu_second": 251.0, "ratio": 4.04}
    expected = "240 pictures/s (251 per second of CPU time), each 4.0 times an empty one: "
    assert as_text(figures).endswith(f"{expected}Albot/Explore-v0 with odometry")


def test_ratslam_has_its_keys_and_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        ratslam, "measure_ratslam", partial(measure_ratslam, minutes=1, rounds=1, steps=4)
    )
    figures: Any = bench("--part", "ratslam")
    *floors, scenes, laser, correction = figures["ratslam"]
    for floor in floors:
        assert floor["experiences"] > 1
        assert 1e6 / floor["readings_per_second"] > min(floor["us_early"], floor["us_late"]) / 2 > 0
    for batch in (scenes, laser):
        assert batch["steps_per_second"] > 0
    assert correction["passes_per_second"] > 0
    lines = as_text(figures).splitlines()[1:]
    assert "readings/s  ratslam-scenes" in lines[0]
    assert "readings/s  ratslam-paper" in lines[1]
    assert "readings/s  ratslam:" in lines[2]
    assert "robot steps/s of a processor  ratslam-scenes: 4 environments" in lines[3]
    assert "robot steps/s of a processor  ratslam: 4 environments" in lines[4]
    assert "passes/s of 12,881 experiences, 14,485 transitions" in lines[5]


def test_a_missing_learner_is_a_line(laser_alone: dict[str, object]) -> None:
    figures = laser_alone | {"learner": {"missing": "torch: pip install it"}}
    assert as_text(figures).splitlines()[-1] == (
        "learner     not measured, missing: torch: pip install it"
    )


def test_mappers_are_timed_on_any_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapper, "BATCHED_FROM", 0.0)  # However slow it is here.
    readings = tour_readings()[:30]
    rows = measure_mappers(("albot1", "odometry"), readings, rounds=1)
    assert [row["name"] for row in rows] == ["albot1", "odometry"]
    for key in ("readings_per_second", "batch_readings_per_second", "row_readings_per_second"):
        assert all(row[key] > 0 for row in rows)  # type: ignore[operator]


def test_a_long_journey_is_split_fast(laser_alone: dict[str, object]) -> None:
    (row,) = measure_splitting(rounds=3)
    assert row["paths"] == 500
    assert row["regions"] > 1  # type: ignore[operator]
    assert 0 < row["split_ms"] < 50  # type: ignore[operator]
    figures = {**laser_alone, "mapper": [row]}
    assert "ms to split into" in as_text(figures)


def test_a_mappers_line_tells_what_a_batch_does(laser_alone: dict[str, object]) -> None:
    row = {"name": "odometry", "surfaces": 7, "readings_per_second": 1500.0}
    batch = {"batch": 4, "batch_readings_per_second": 2e6, "row_readings_per_second": 3e4}
    figures = {**laser_alone, "mapper": [row | batch, row]}
    lines = [line for line in as_text(figures).splitlines() if line.startswith("mapper")]
    alone = "mapper            7 surfaces     1,500 readings/s  odometry"
    assert lines[0] == f"{alone}; 4 at once 2,000,000 in total, 30,000 when each is updated alone"
    assert lines[1] == alone


def test_systems_of_metric_slam_are_timed_beside_the_yardstick(monkeypatch, laser_alone) -> None:
    names = {"scan-matching", "gmapping"}
    monkeypatch.setattr(slam, "installed_mappers", lambda: names)
    rows = slam.measure_slam(tour_readings()[:5], rounds=1)
    assert [(row["name"], row["ratio_to_karto"]) for row in rows] == [
        ("scan-matching", None),
        ("gmapping", None),
    ]
    monkeypatch.setattr(slam, "YARDSTICK", "gmapping")
    rows = slam.measure_slam(tour_readings()[:5], rounds=1)
    assert rows[1]["ratio_to_karto"] == 1.0
    assert rows[0]["ratio_to_karto"] > 1.0
    lines = as_text({**laser_alone, "slam": rows}).splitlines()
    assert lines[-1].startswith("slam ")
    assert lines[-1].endswith("1.00 times karto)  gmapping")


def test_what_a_loop_over_mappers_costs_is_told(laser_alone: dict[str, object]) -> None:
    readings = tour_readings()[:10]
    (row,) = measure_looping(("albot1", "association"), readings, rounds=1)
    assert row["name"] == "association"  # albot1 has a batch of its own.
    assert row["ratio"] == pytest.approx(1 + row["above_us"] / row["own_us"])  # type: ignore[operator]
    row = {"name": "x", "robots": 256, "own_us": 20.0, "above_us": 12.34, "ratio": 1.617}
    lines = as_text({**laser_alone, "mapper": [row]}).splitlines()
    line = "256 in a loop     12.3 µs/reading above the 20.0 of its own update (1.62 times)  x"
    assert f"mapper          {line}" in lines


def test_a_large_map_knows_the_floor_again_and_again_and_maps_on() -> None:
    floor = load_world("office-ring").walls
    walls = copies_of(floor, 1500)
    assert walls.shape == (1500, 4)
    assert np.array_equal(walls[: len(floor)], floor)
    # The copies lie apart: no two share a wall.
    assert len(np.unique(walls, axis=0)) == len(walls)
    readings = tour_readings()
    mapping = make_mapper("albot1")
    mapping.update(readings[0])
    few = len(mapping.snapshot().segments)
    mapping.restore(with_surfaces(mapping.state(), walls))
    assert len(mapping.snapshot().segments) == few + 1500
    for reading in readings[1:6]:
        mapping.update(reading)
    assert np.isfinite(mapping.estimate.pose).all()


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--part", "lazer"], "one of laser"),
        (["--log", "missing.log"], "file not found"),
        (["--part", "startup", "--out", "page.md"], "--part journey or --part peers"),
        (["--part", "journey", "--out", "j.txt"], "a name that ends in .md, found j.txt"),
        (["--part", "startup", "--log", "a.log"], "--part mapper or slam, whose mappers map it"),
        (["--part", "startup", "--rounds", "2"], "--part env, which is measured in rounds"),
    ],
)
def test_bad_input_is_one_line(args: list[str], message: str, tmp_path: Path) -> None:
    outcome = CliRunner().invoke(albot, ["bench", *args])
    assert isinstance(outcome.exception, InputError)
    assert message in str(outcome.exception)
