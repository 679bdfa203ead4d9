"""Experiments 4 and 5 on a small loop, and where revisiting begins."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from albot_cli.group import albot
from albot_core.mappers.albot1.config import Albot1Config
from albot_experiments import albot1_e4, albot1_e5, revisiting
from albot_experiments.tours import TourRecord, driven_tour, thinned_views
from albot_maps import load_world


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The square corridor in place of the office."""
    monkeypatch.setattr(revisiting, "WORLD", "square-loop")
    monkeypatch.setattr(revisiting, "TOUR", "loop")
    monkeypatch.setattr(revisiting, "HOME_ROOM", "south")


def test_revisiting_begins_where_the_robot_comes_back():
    world = load_world("office-ring")
    home, away = [11.2, 6.6, 0.0], [1.3, 20.0, 0.0]
    for rooms, last in (([home, home, away, away, home, away], 3), ([home, away, away], 2)):
        journey = TourRecord(readings=(), truth=np.array(rooms))
        assert revisiting.before_revisiting(world, journey) == last


def test_only_ends_at_grazing_incidence_shorten_the_bare_corridor():
    world = load_world("office-ring")
    ridden = driven_tour(world, np.array([[1.3, 12.0], [1.3, 25.0]]), np.random.default_rng(2))
    journey = thinned_views(ridden, 0.1, 1.0)
    lengths = {
        name: revisiting.map_drive(name, world, journey).corridor
        for name in ("albot1", "albot1-tracked", "albot1-thesis")
    }
    assert all(length == pytest.approx(1.0, abs=0.1) for length in lengths.values()), lengths
    grazing = Albot1Config.thesis()
    grazing = replace(grazing, view=replace(grazing.view, grazing_ends=True))
    short = revisiting.map_drive("albot1-thesis", world, journey, grazing).corridor
    assert short is not None and short < 0.7


def test_slam_is_measured_by_its_grid_and_its_corrected_path():
    world = load_world("square-loop")
    ridden = driven_tour(world, world.tours["loop"], np.random.default_rng(1))
    drive = revisiting.map_drive("scan-matching", world, thinned_views(ridden, 1.0, 0.2))
    assert len(drive.cells)
    assert drive.shape_after.precision > 0.9 and drive.shape_after.recall > 0.9
    assert drive.shape_after.path_error < 0.2


def test_the_tour_of_the_office_begins_in_the_home_room():
    world = load_world("office-ring")
    start = world.tours["revisit"][0]
    assert world.room_at(*start) == revisiting.HOME_ROOM


@pytest.mark.parametrize(
    ("experiment", "most"), [(albot1_e4, 0.4), (albot1_e5, 0.65)], ids=["e4", "e5"]
)
def test_the_small_loop_keeps_its_shape(small, experiment, most, monkeypatch):
    if experiment is albot1_e5:
        monkeypatch.setattr(albot1_e5, "SLAM", ("scan-matching", "grid-slam"))
    report = experiment.run(range(1))
    assert most == experiment.MOST_UPDATES
    assert report.measured["shape_kept"]
    assert report.measured["update_share"] <= most
    assert report.holds
    views = report.measured["views"]
    assert report.measured["views_before"] < views
    turns = 3 * 90 / (1 if experiment is albot1_e4 else 10)
    moves = 17.5 / experiment.SPACING.distance
    assert 0.9 * moves < views < 1.1 * moves + turns + 2
    assert set(report.pictures) == {"maps"} | ({"slam"} if experiment is albot1_e5 else set())
    assert report.verdicts["albot1"]
    if experiment is albot1_e5:
        assert report.measured["slam_shape_kept"]


def test_all_are_run_by_one_command(small, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from albot_cli import experiment as command

    few = {name: command.EXPERIMENTS[name] for name in ("albot1-e2", "albot1-e4")}
    monkeypatch.setattr(command, "EXPERIMENTS", few)
    monkeypatch.setattr(command, "ABLATED", tuple(few))
    out = tmp_path / "docs" / "experiments"
    out.parent.mkdir()
    args = ["experiment", "run", "all", "--seeds", "1", "--json", "--out", str(out)]
    outcome = CliRunner().invoke(albot, args, catch_exceptions=False)
    reports = json.loads(outcome.stdout)["experiments"]
    assert [report["id"] for report in reports] == list(few)
    page = (tmp_path / "docs" / "experiments.md").read_text()
    for name in few:
        assert f"experiments/{name}/report.md" in page
        assert {"result.json", "report.md"} < {path.name for path in (out / name).iterdir()}
    runner = CliRunner()
    args = ["experiment", "ablation", str(out)]
    runner.invoke(albot, args, catch_exceptions=False)
    table = (tmp_path / "docs" / "albot1_ablation.md").read_text()
    assert "`albot1-thesis` | `albot1-tracked` | `albot1` | `odometry`" in table
    assert "| after_wall_recall |" in table and "| **reached** |" in table
