"""Experiments 4 and 5 on a small loop, and where revisiting begins."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from albot_cli.group import albot
from albot_experiments import albot1_e4, albot1_e5, revisiting
from albot_experiments.tours import Journey, driven_tour, thinned_views
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
        journey = Journey(readings=(), truth=np.array(rooms))
        assert revisiting.before_revisiting(world, journey) == last


def test_the_thesis_takes_the_bare_corridor_for_short_where_views_are_many():
    world = load_world("office-ring")
    ridden = driven_tour(world, np.array([[1.3, 12.0], [1.3, 25.0]]), np.random.default_rng(2))
    many, few = (thinned_views(ridden, spacing, 1.0) for spacing in (0.1, 1.0))
    lengths = {
        (name, how): revisiting.map_drive(name, world, journey).corridor
        for name in ("albot1", "albot1-thesis")
        for how, journey in (("many", many), ("few", few))
    }
    assert lengths["albot1-thesis", "many"] < 0.7
    for other in (("albot1", "many"), ("albot1", "few"), ("albot1-thesis", "few")):
        assert lengths[other] == pytest.approx(1.0, abs=0.1)


def test_the_tour_of_the_office_begins_in_the_home_room():
    world = load_world("office-ring")
    start = world.tours["revisit"][0]
    assert world.room_at(*start) == revisiting.HOME_ROOM


@pytest.mark.parametrize(
    ("experiment", "most"), [(albot1_e4, 0.4), (albot1_e5, 0.65)], ids=["e4", "e5"]
)
def test_the_small_loop_keeps_its_shape(small, experiment, most):
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
    assert set(report.pictures) == {"maps"}


def test_all_are_run_by_one_command(small, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from albot_cli import experiment as command

    few = {name: command.EXPERIMENTS[name] for name in ("albot1-e4", "albot1-e5")}
    monkeypatch.setattr(command, "EXPERIMENTS", few)
    out = tmp_path / "docs" / "experiments"
    out.parent.mkdir()
    args = ["experiment", "run", "all", "--seeds", "1", "--json", "--out", str(out)]
    outcome = CliRunner().invoke(albot, args, catch_exceptions=False)
    reports = json.loads(outcome.stdout)["experiments"]
    assert [report["id"] for report in reports] == list(few)
    page = (tmp_path / "docs" / "experiments.md").read_text()
    for name in few:
        assert f"experiments/{name}/report.md" in page
        assert {path.name for path in (out / name).iterdir()} == {
            "result.json",
            "report.md",
            "maps.png",
        }
