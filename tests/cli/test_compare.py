"""`albot compare`: figures, files, sources, and runs that die."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from albot_agents.engine import local
from albot_cli.comparison_report import FILES, as_markdown, panels_of, rows_of
from albot_cli.mapper_runs import MapperChoice, MapperRun, RunResult, Source, no_figures
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.picture import maps_figure
from albot_core.export.tum import write_tum
from albot_core.logs.reader import read_log
from albot_core.mappers.registry import MAPPERS, installed_mappers, mapper_spec
from albot_core.maps.layers import MapSnapshot, SegmentsLayer
from albot_maps import load_world
from tests.cli.conftest import expect_error, figures
from tests.env.rendering.page.test_document import read

KEYS = {
    "mapper",
    "ate_rmse_m",
    "corrected_ate_rmse_m",
    "relations",
    "map_entropy",
    "updates",
    "map_bytes",
    "readings_per_second",
    "peak_mib",
}
"""What other programs read of a row."""


def test_figures_and_files(corridor, truth_file, tmp_path, call, in_process):
    out = tmp_path / "side-by-side"
    words = ("--mappers", "odometry,albot1", "--reference", truth_file, "--out", out, "--json")
    found = figures(call("compare", corridor[0], *words))
    assert [row["mapper"] for row in found["rows"]] == ["odometry", "albot1"]
    assert all(row.keys() >= KEYS for row in found["rows"])
    odometry, albot1 = found["rows"]
    mapped = figures(
        call("map", corridor[0], "--mapper", "albot1", "--reference", truth_file, "--json")
    )
    for key in ("ate_rmse_m", "updates", "surfaces", "map_entropy"):
        assert albot1[key] == pytest.approx(mapped[key])
    assert odometry["ate_rmse_m"] == pytest.approx(mapped["odometry_ate_rmse_m"])
    # Its own frame is where the robot set out, so what the odometer is short by adds up.
    assert odometry["unaligned_rmse_m"] > 1.5 * odometry["ate_rmse_m"]
    assert all(row["peak_mib"] > 20 and row["map_bytes"] > 1000 for row in found["rows"])
    assert {path.name for path in out.iterdir()} == set(FILES)
    assert json.loads((out / "comparison.json").read_text())["rows"] == found["rows"]
    lines = (out / "comparison.md").read_text().splitlines()
    assert [line.split(" | ")[0] for line in lines[2:]] == ["| odometry", "| albot1"]
    with Image.open(out / "comparison.png") as picture:
        assert picture.width > 1.2 * picture.height


def test_the_page_plays_all_maps_beside_the_truth(corridor, truth_file, tmp_path, call, in_process):
    words = ("--mappers", "odometry,albot1", "--reference", truth_file, "--json")
    found = figures(call("compare", corridor[0], *words, "--html", tmp_path / "a.html"))
    assert found["files"] == {"page": str(tmp_path / "a.html")}
    facts, arrays = read((tmp_path / "a.html").read_bytes())
    assert [track["mapper"] for track in facts["tracks"]] == ["odometry", "albot1"]
    assert len(arrays["times"]) == len(arrays["poses"]) == len(arrays["scans"]) == found["readings"]
    for number, row in enumerate(found["rows"]):
        assert facts["curves"][number] == f"position error of {row['mapper']}"
        errors = arrays[f"curve.{number}"]
        assert np.sqrt((errors**2).mean()) == pytest.approx(row["ate_rmse_m"], rel=1e-4)
        surfaces = arrays[f"track.{number}.0.deaths"]
        assert (surfaces < 0).sum() == row["surfaces"]
    assert facts["command"].startswith(f"albot compare {corridor[0]} --mappers odometry,albot1")
    assert "--html" not in facts["command"]


def test_the_page_of_a_world_shows_its_walls(call, in_process, tmp_path):
    words = ("--mappers", "odometry", "--steps", 30, "--sonar", "none", "--json")
    figures(call("compare", "square-loop", *words, "--html", tmp_path / "a.html"))
    _, arrays = read((tmp_path / "a.html").read_bytes())
    assert arrays["poses"][0].tolist() == [0, 0, 0]  # Home, where all maps begin.
    lengths = np.hypot(*(arrays["walls"][:, 2:] - arrays["walls"][:, :2]).T) / 1000
    walls = load_world("square-loop").walls
    assert lengths == pytest.approx(np.hypot(*(walls[:, 2:] - walls[:, :2]).T), abs=0.002)


def test_by_default_all_that_see_by_the_sensors(corridor, call, in_process):
    found = figures(call("compare", corridor[0], "--json"))
    fitting = [name for name in installed_mappers() if mapper_spec(name).sensors <= {"laser"}]
    assert [row["mapper"] for row in found["rows"]] == fitting
    assert all(row["ate_rmse_m"] is None for row in found["rows"])


def test_what_was_not_read_is_said(corridor, call, tmp_path, in_process):
    path = tmp_path / "torn.log"
    lines = corridor[0].read_text().splitlines()
    path.write_text("\n".join([*lines[:20], lines[20][:300]]))
    words = ("compare", path, "--mappers", "odometry", "--keep-going")
    assert "line 21" in figures(call(*words, "--json"))["left_out"]["reason"]
    assert "not read: 1 line, 1 scan, line 21 (" in call(*words).stdout


def test_a_reference_of_another_log_is_named(corridor, call, tmp_path, in_process):
    path, truth = corridor
    other, relations = tmp_path / "other.tum", tmp_path / "other.relations"
    write_tum(Trajectory(stamps=truth.stamps + 1e6, poses=truth.poses), other)
    relations.write_text("1e6 2e6 0 0 0 0 0 0\n")
    words = "compare", path, "--mappers", "odometry"
    expect_error(call(*words, "--reference", other), "other.tum", "stamps of another log")
    expect_error(call(*words, "--relations", relations), "other.relations", "stamps of another log")


def test_an_episode_as_its_mapper_saw_it(episode_file, call, in_process):
    found = figures(call("compare", episode_file, "--mappers", "odometry", "--json"))
    replayed = figures(call("play", episode_file, "--headless", "--json"))
    (row,) = found["rows"]
    assert found["readings"] == 41
    assert (row["updates"], row["surfaces"]) == (replayed["updates"], replayed["surfaces"])
    assert 0 < row["ate_rmse_m"] <= row["unaligned_rmse_m"] * (1 + 1e-9)


def test_seeds_of_a_world(call, in_process, tmp_path):
    """Of `random:KIND` each seed is a world; the row is the median, the worst is told."""
    words = ("--seeds", "3..5", "--steps", 60, "--mappers", "odometry", "--sonar", "none")
    found = figures(call("compare", "random:hall", *words, "--json"))
    (row,) = found["rows"]
    errors = [run["ate_rmse_m"] for run in row["runs"]]
    assert [run["seed"] for run in row["runs"]] == [3, 4, 5]
    assert len(set(errors)) == 3
    assert row["ate_rmse_m"] == pytest.approx(np.median(errors))
    assert row["worst_ate_rmse_m"] == max(errors)
    again = figures(call("compare", "random:hall", *words, "--json"))
    assert [run["ate_rmse_m"] for run in again["rows"][0]["runs"]] == errors


def test_thresholds_from_a_file(corridor, tmp_path, call, in_process):
    thresholds = tmp_path / "far.yaml"
    thresholds.write_text("view_spacing: 5.0\nview_turn: 3.0\n")
    both = f"albot1,albot1={thresholds}"
    usual, sparse = figures(call("compare", corridor[0], "--mappers", both, "--json"))["rows"]
    assert sparse["mapper"] == f"albot1={thresholds}"
    assert sparse["updates"] < usual["updates"]


def test_a_run_that_dies_leaves_the_others(corridor, call, monkeypatch):
    """In processes of their own, as users have it: each imports a user's own mapper.

    A run's peak is its own, however much memory the process has that started it.
    """
    monkeypatch.setattr(local, "RERUNS", 0)  # Each takes a new process some seconds.
    memory = np.ones(50_000_000)
    try:
        names = "tests.cli.mortal:mortal,odometry"
        result = call("compare", corridor[0], "--mappers", names, "--json")
    finally:
        MAPPERS.pop("mortal", None)
        sys.modules.pop("tests.cli.mortal", None)
    assert result.return_value == 1
    died, whole = figures(result)["rows"]
    assert died["runs"][0]["error"].startswith("the process died: signal SIGKILL")
    assert whole["runs"][0]["error"] is None
    assert whole["updates"] >= 1
    assert 20 < whole["peak_mib"] < memory.nbytes / 2**20


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("offic-ring",), "did you mean office-ring?"),
        (("nowhere.log",), "nowhere.log: file not found"),
        (("nowhere.mcap",), "nowhere.mcap: file not found"),
        (("square-loop", "--reference", "a.tum"), "--reference: expected a log"),
        (("LOG", "--laser", "short"), "--laser: expected a world"),
        (("LOG", "--agent", "gap-explorer"), "--agent: expected a world"),
        (("LOG", "--steps", "100"), "--steps: expected a world"),
        (("LOG", "--mappers", "albt1"), "did you mean albot1?"),
        (("LOG", "--mappers", "albot1, albot1"), "found albot1 twice"),
        (("LOG", "--mappers", "albot0"), "found albot0, which needs sonar"),
        (("LOG", "--mappers", "albot1=none.yaml"), "none.yaml: file not found"),
        (("LOG", "--mappers", "albot1="), "--mappers: expected NAME or NAME=FILE, found albot1="),
        (("LOG", "--seeds", "3..1"), "--seeds: expected a range"),
        (("square-loop", "--agent", "albot1-homing"), "found albot1-homing, which is for"),
        (("square-loop", "--odometer", "pionier"), "did you mean pioneer?"),
    ],
)
def test_bad_input(words, message, corridor, call):
    log = str(corridor[0])
    result = call("compare", *(log if word == "LOG" else word for word in words))
    assert isinstance(result.exception, InputError)
    assert message in str(result.exception)


def test_nothing_is_overwritten_unasked(corridor, tmp_path, call):
    (tmp_path / "comparison.md").write_text("mine")
    result = call("compare", corridor[0], "--out", tmp_path)
    assert "comparison.md: expected no existing file, or --force" in str(result.exception)
    assert (tmp_path / "comparison.md").read_text() == "mine"


def test_rows_and_columns_of_what_is_known(corridor):
    """Medians of groups as well; a column of nothing is left out; a dead run counts for nothing."""
    choice = MapperChoice(label="one", name="odometry")
    results = []
    for seed, error in enumerate((0.3, 0.1, 0.2)):
        run = MapperRun(choice=choice, source=Source(log=read_log(corridor[0]), seed=seed))
        relations = {"translation_mean_m": error / 2, "rotation_mean_deg": 1.0}
        found = {"ate_rmse_m": error, "relations": relations, "updates": seed}
        results.append(RunResult(figures=no_figures(run) | found))
    dead = MapperRun(choice=choice, source=Source(log=read_log(corridor[0]), seed=3))
    results.append(RunResult(figures=no_figures(dead) | {"error": "the process died"}))
    (row,) = rows_of([choice], results)
    assert (row["ate_rmse_m"], row["worst_ate_rmse_m"], row["updates"]) == (0.2, 0.3, 1)
    assert row["relations"]["translation_mean_m"] == pytest.approx(0.1)
    assert as_markdown([row]).splitlines() == [
        "| mapper | ATE, m | relations, m | relations, ° | updates |",
        "| --- | ---: | ---: | ---: | ---: |",
        "| one | 0.200 (0.300) | 0.100 | 1.00 | 1 |",
        "",
        "Medians over the seeds; in brackets the largest ATE of a seed.",
    ]


def test_panels_tell_what_the_table_tells(corridor):
    """The first seed's error by name beside the table's median; and why a panel is empty."""
    source = Source(log=read_log(corridor[0]), seed=0)
    drawn, empty, dead = choices = [
        MapperChoice(label=name, name="odometry") for name in ("drawn", "empty", "dead")
    ]
    path = Trajectory(stamps=np.arange(3.0), poses=np.zeros((3, 3)))
    wall = SegmentsLayer(segments=np.array([[0.0, 0.0, 40.0, 5.0]]))
    results = []
    for choice, snapshot in ((drawn, MapSnapshot(layers=(wall,))), (empty, MapSnapshot(layers=()))):
        for seed, error in enumerate((0.3, 0.1, 0.2)):
            run = MapperRun(choice=choice, source=replace(source, seed=seed))
            found = no_figures(run) | {"ate_rmse_m": error}
            results.append(RunResult(figures=found, snapshot=snapshot, path=path))
    run = MapperRun(choice=dead, source=source)
    results.append(RunResult(figures=no_figures(run) | {"error": "the process died"}))
    panels = panels_of(rows_of(choices, results), results, source)
    assert [panel.title for panel in panels] == [
        "drawn\nATE 0.300 m (seed 0; median 0.200 m)",
        "empty\nATE 0.300 m (seed 0; median 0.200 m)",
        "dead",
    ]
    assert [panel.note for panel in panels] == [
        "", "a path, but no map", "no map: the process died",
    ]  # fmt: skip
    figure = maps_figure(panels)
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}) == 1
    assert [axes.get_xlabel() for axes in figure.axes] == 3 * ["x (m)"]
    assert [axes.get_ylabel() for axes in figure.axes] == ["y (m)", "", ""]
    names = {text.get_text() for text in figure.legends[0].get_texts()}
    assert names == {"believed path", "surfaces", "home"}
