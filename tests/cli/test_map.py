"""`albot map` and `albot mappers`: figures, files and errors."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from PIL import Image

import albot_cli.map
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.tum import write_tum
from albot_core.geometry.types import Poses
from albot_core.logs.reader import read_reference
from albot_core.mappers.map_file import load_map
from albot_core.mappers.mapper import Estimate
from albot_core.mappers.odometry.mapper import OdometryMapper
from albot_core.mappers.registry import installed_mappers, mapper_names, mapper_spec
from tests.cli.conftest import ERRORS, FILES, PLACES, expect_error, figures

KEYS = {
    "log",
    "mapper",
    "scans",
    "path_m",
    "seconds",
    "scans_per_second",
    "updates",
    "surfaces",
    "places",
    "ate_rmse_m",
    "odometry_ate_rmse_m",
    "relations",
    "map_entropy",
    "odometry_map_entropy",
}
RELATION_KEYS = {
    "count",
    "translation_mean_m",
    "translation_std_m",
    "rotation_mean_deg",
    "rotation_std_deg",
}


SEE_BY_LASER = [name for name in installed_mappers() if mapper_spec(name).sensors <= {"laser"}]


@pytest.mark.parametrize("mapper", SEE_BY_LASER)
def test_what_json_holds(mapper, corridor, call):
    found = figures(call("map", corridor[0], "--mapper", mapper, "--json"))
    assert found.keys() >= KEYS
    assert found["log"] == "corridor.log"
    assert found["mapper"] == mapper
    assert found["scans"] == 28
    assert found["path_m"] == pytest.approx(0.96 * 0.4 * 27, abs=0.01)
    assert found["updates"] >= 1
    layers = mapper_spec(mapper).layers
    assert found["surfaces"] >= (3 if "segments" in layers else 0)
    assert found["seconds"] > 0
    assert found["scans_per_second"] == pytest.approx(28 / found["seconds"])
    assert (found["places"] is None) == ("place_graph" not in layers)
    if mapper.startswith("albot1"):
        assert found["places"] == 1
    unknown = ("ate_rmse_m", "odometry_ate_rmse_m", "relations", "files", "left_out")
    assert all(found[key] is None for key in unknown)


def test_the_default_mapper_is_albot1(corridor, call):
    assert figures(call("map", corridor[0], "--json"))["mapper"] == "albot1"


def test_the_errors_against_a_reference(corridor, truth_file, call):
    found = figures(
        call("map", corridor[0], "--mapper", "odometry", "--reference", truth_file, "--json")
    )
    assert found["odometry_ate_rmse_m"] == pytest.approx(found["ate_rmse_m"])
    # 4 % short along 10.8 m: ± 0.216 m at the ends once aligned, its rms that over √3.
    assert found["ate_rmse_m"] == pytest.approx(0.216 / np.sqrt(3), rel=0.15)


def test_the_errors_against_relations(corridor, call):
    path, _ = corridor
    relations = path.with_name("true.relations")
    relations.write_text("0.5 1.5 0.4 0 0 0 0 0\n1.5 2.5 0.4 0 0 0 0 0\n77 88 0 0 0 0 0 0\n")
    found = figures(call("map", path, "--mapper", "odometry", "--relations", relations, "--json"))
    assert found["relations"].keys() == RELATION_KEYS
    assert found["relations"]["count"] == 2
    assert found["relations"]["translation_mean_m"] == pytest.approx(0.016, abs=1e-4)
    turns = np.rad2deg([1.3 * 0.02 * np.cos(k) for k in (1, 2)])
    assert found["relations"]["rotation_mean_deg"] == pytest.approx(np.abs(turns).mean(), abs=1e-3)


def test_an_episode_is_a_log_that_knows_where_the_robot_was(episode_file, call):
    found = figures(call("map", episode_file, "--mapper", "odometry", "--json"))
    assert (found["log"], found["scans"]) == ("watched.mcap", 41)
    assert found["ate_rmse_m"] == pytest.approx(found["odometry_ate_rmse_m"])
    assert 0 < found["ate_rmse_m"] < 0.5


def test_the_table_shows_the_odometer_beside_the_mapper(corridor, truth_file, call):
    result = call("map", corridor[0], "--mapper", "odometry", "--reference", truth_file)
    lines = result.stdout.splitlines()
    assert lines[0].startswith("corridor.log: 28 scans along 10.4 m")
    header, error, metre, turn, entropy = lines[-5:]
    assert header.split() == ["odometry", "odometer"]
    assert re.fullmatch(r"trajectory error, ATE rmse +(0\.1\d m) +\1", error)
    assert re.fullmatch(r"error per metre, RPE rmse +(0\.\d{3} m) +\1", metre)
    assert re.fullmatch(r"turn error per metre, RPE rmse +(\d\.\d\d°) +\1", turn)
    assert re.fullmatch(r"map entropy, lower is sharper +(-\d\.\d\d) +\1", entropy)


def test_the_errors_over_time(corridor, truth_file, call, tmp_path):
    path, truth = corridor
    out = tmp_path / "out"
    words = "map", path, "--reference", truth_file
    found = figures(call(*words, "--out", out, "--json"))
    for errors, rmse in (
        (found["errors"], found["ate_rmse_m"]),
        (found["odometry_errors"], found["odometry_ate_rmse_m"]),
    ):
        assert errors["ape_m"]["rmse"] == pytest.approx(rmse)
        assert errors["ape_m"]["count"] == len(truth.stamps)
        for kind in errors.values():
            assert kind["min"] <= kind["median"] <= kind["max"]
            assert kind["rmse"] ** 2 == pytest.approx(kind["mean"] ** 2 + kind["std"] ** 2)
    head, *lines = (out / "errors.csv").read_text().splitlines()
    assert head == "stamp_s,albot1_ape_m,odometer_ape_m"
    rows = np.array([line.split(",") for line in lines], float)
    assert rows[:, 0] == pytest.approx(truth.stamps, abs=1e-5)
    assert np.sqrt(np.mean(rows[:, 1] ** 2)) == pytest.approx(found["ate_rmse_m"], abs=1e-5)
    table = (out / "errors.md").read_text()
    mine = found["errors"]["rpe_m"]
    assert f"| albot1 | RPE, m per metre | {mine['rmse']:.4f} | {mine['mean']:.4f} |" in table
    assert (out / "errors.png").read_bytes().startswith(b"\x89PNG")
    assert figures(call("map", path, "--json"))["errors"] is None


def test_the_figure_for_a_paper(corridor, call, tmp_path):
    drawn = tmp_path / "map.svg"
    found = figures(call("map", corridor[0], "--figure", drawn, "--json"))
    assert found["files"] == {"figure": str(drawn)}
    assert ">x (m)</text>" in drawn.read_text()


def test_recognition_is_measured_where_the_truth_is_known(corridor, truth_file, call, tmp_path):
    asked = ("map", corridor[0], "--reference", truth_file, "--recognition")
    found = figures(call(*asked, "--out", tmp_path / "out", "--json"))["recognition"]
    assert (tmp_path / "out" / "recognition.png").read_bytes().startswith(b"\x89PNG")
    # A corridor once along: nothing is seen twice, and whatever is claimed is a false alarm.
    assert found["queries"] == 0
    assert found["recall"] == {"1.00": None, "0.99": None, "0.95": None}
    assert "recognised: nothing to measure, because no place was seen again" in call(*asked).stdout
    expect_error(call("map", corridor[0], "--recognition"), "--recognition", "a reference")


def test_the_files(corridor, truth_file, call, tmp_path):
    out = tmp_path / "new" / "out"
    found = figures(call("map", corridor[0], "--reference", truth_file, "--out", out, "--json"))
    assert {path.name for path in out.iterdir()} == FILES | PLACES | ERRORS
    assert {Path(path) for path in found["files"].values()} == set(out.iterdir())
    shown = call("map", corridor[0], "--mapper", "odometry", "--out", tmp_path / "again").stdout
    assert all(f"  {path}\n" in shown for path in (tmp_path / "again").iterdir())
    assert list(out.parent.iterdir()) == [out]
    mapper = load_map(out / "map.albot")
    assert mapper.spec.name == "albot1"
    believed = read_reference(out / "trajectory.tum")
    np.testing.assert_array_equal(believed.stamps, corridor[1].stamps)
    np.testing.assert_allclose(believed.poses[-1], mapper.estimate.pose, atol=1e-9)
    features = json.loads((out / "surfaces.geojson").read_text())["features"]
    assert sum("kind" not in feature["properties"] for feature in features) == found["surfaces"]
    assert sum("kind" in feature["properties"] for feature in features) == found["places"] == 1
    assert (out / "events.txt").read_text() == "view 1: set out in P1\n"
    assert list(nx.read_graphml(out / "network.graphml").nodes) == ["0"]
    with Image.open(out / "map.png") as picture:
        assert picture.format == "PNG"


def test_a_mapper_without_places_leaves_no_files_of_places(corridor, call, tmp_path):
    found = figures(
        call("map", corridor[0], "--mapper", "odometry", "--out", tmp_path / "a", "--json")
    )
    assert {path.name for path in (tmp_path / "a").iterdir()} == FILES
    assert set(found["files"]) == {"trajectory", "surfaces", "picture", "map"}


def test_the_files_are_the_same_each_time(corridor, call, tmp_path):
    for name in ("a", "b"):
        call("map", corridor[0], "--out", tmp_path / name)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_files_of_others_stay(corridor, call, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    (out / "map.png").write_text("old")
    expect_error(call("map", corridor[0], "--out", out), "map.png", "no existing file, or --force")
    assert {path.name for path in out.iterdir()} == {"notes.txt", "map.png"}
    call("map", corridor[0], "--out", out, "--force")
    assert {path.name for path in out.iterdir()} == FILES | PLACES | {"notes.txt"}
    assert (out / "map.png").read_bytes().startswith(b"\x89PNG")


def test_all_files_or_none(corridor, call, tmp_path, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(albot_cli.map, "save_figure", fail)
    result = call("map", corridor[0], "--out", tmp_path / "out")
    assert result.exception is not None
    assert [path.name for path in tmp_path.iterdir()] == ["corridor.log"]


def test_bad_input_is_named(corridor, truth_file, call, tmp_path):
    path = corridor[0]
    expect_error(call("map", tmp_path / "none.log"), "none.log: file not found")
    expect_error(call("map", path, "--mapper", "albt1"), "did you mean albot1?")
    expect_error(call("map", path, "--reference", path), "corrected poses")
    expect_error(call("map", path, "--relations", path), "line 1", "eight finite numbers")
    expect_error(call("map", path, "--out", truth_file), "a folder to write to")
    expect_error(call("map", path, "--out", truth_file / "out"), "a folder to write to")
    (link := path.with_name("link")).symlink_to("nowhere")
    expect_error(call("map", path, "--out", link), "found a link that leads nowhere")


def test_a_mapper_that_believes_to_be_nowhere_is_named(corridor, call, tmp_path, monkeypatch):
    estimate = OdometryMapper.estimate.fget

    def nowhere(mapper: OdometryMapper) -> Estimate:
        found = estimate(mapper)
        found.pose[0] = np.nan if found.pose[0] > 2 else found.pose[0]
        return found

    monkeypatch.setattr(OdometryMapper, "estimate", property(nowhere))
    result = call("map", corridor[0], "--mapper", "odometry", "--out", tmp_path / "out")
    expect_error(result, "mapper odometry, reading 6, estimate.pose: expected an array of 3 finite")
    assert not (tmp_path / "out").exists()


def test_corrected_poses_that_lack_a_reading_are_named(corridor, call, tmp_path, monkeypatch):
    def corrected(mapper: OdometryMapper) -> Poses:
        return np.zeros((3, 3))

    monkeypatch.setattr(OdometryMapper, "corrected_poses", corrected, raising=False)
    result = call("map", corridor[0], "--mapper", "odometry", "--out", tmp_path / "out")
    expect_error(result, "mapper odometry", "corrected_poses()", "found an array of shape (3, 3)")
    assert not (tmp_path / "out").exists()


def test_a_folder_is_filled_and_nothing_around_it_touched(corridor, call, tmp_path, monkeypatch):
    out = tmp_path / "around" / "out"
    out.mkdir(parents=True)
    around = []
    draw = albot_cli.map.save_figure

    def draw_and_look(*arguments: object, **named: Any) -> None:
        around.extend(out.parent.iterdir())
        draw(*arguments, **named)

    monkeypatch.setattr(albot_cli.map, "save_figure", draw_and_look)
    assert call("map", corridor[0], "--out", out).exit_code == 0
    assert around == [out]
    assert {path.name for path in out.iterdir()} == FILES | PLACES


def test_a_reference_of_another_log_is_named(corridor, call, tmp_path):
    path, truth = corridor
    other = tmp_path / "other.tum"
    write_tum(Trajectory(stamps=truth.stamps + 1e6, poses=truth.poses), other)
    relations = tmp_path / "other.relations"
    relations.write_text("1e6 2e6 0 0 0 0 0 0\n")
    expect_error(call("map", path, "--reference", other), "other.tum", "stamps of another log")
    expect_error(call("map", path, "--relations", relations), "stamps of another log")


def test_an_error_over_a_few_moments_says_so(corridor, call, tmp_path):
    path, truth = corridor
    few = tmp_path / "few.tum"
    write_tum(Trajectory(stamps=truth.stamps[:2], poses=truth.poses[:2]), few)
    words = "map", path, "--mapper", "odometry", "--reference"
    assert figures(call(*words, few, "--json"))["ate_moments"] == 2
    assert "trajectory error, ATE rmse over 2 moments " in call(*words, few).stdout
    whole = tmp_path / "whole.tum"
    write_tum(truth, whole)
    assert figures(call(*words, whole, "--json"))["ate_moments"] == len(truth.stamps)
    assert "moments" not in call(*words, whole).stdout
    result = call(*words, few, "--recognition")
    expect_error(result, "--recognition: expected a reference of where the robot was at every scan")


def test_a_torn_episode_is_mapped_and_said_to_be_torn(episode_file, call, tmp_path):
    whole = episode_file.read_bytes()
    path = tmp_path / "torn.mcap"
    path.write_bytes(whole[: len(whole) // 2])
    found = figures(call("map", path, "--mapper", "odometry", "--json"))
    assert 1 < found["scans"] < 41
    assert found["left_out"]["reason"].startswith("torn.mcap: never closed, ends early; read up to")
    assert "not read: the rest (torn.mcap: never closed" in call("map", path).stdout


def test_a_torn_log_and_its_good_lines(corridor, call, tmp_path):
    path = tmp_path / "torn.log"
    lines = corridor[0].read_text().splitlines()
    bad = "ODOM 1 2 x 0 0 0 1 robot 1"
    path.write_text("\n".join([bad, *lines[:19], lines[19][:300], *lines[20:23]]))
    expect_error(call("map", path), "torn.log, line 1: expected")
    found = figures(call("map", path, "--keep-going", "--json"))
    assert found["scans"] == 22
    assert found["left_out"]["lines"] == 2
    assert found["left_out"]["scans"] == 1
    assert "line 1: " in found["left_out"]["reason"]
    shown = call("map", path, "--keep-going").stdout
    assert "not read: 2 lines, 1 scan, lines 1, 21 (torn.log, line 1: " in shown.replace(
        str(tmp_path) + "/", ""
    )
    other = tmp_path / "other.tum"
    truth = corridor[1]
    write_tum(Trajectory(stamps=truth.stamps + 1e6, poses=truth.poses), other)
    result = call("map", path, "--keep-going", "--reference", other)
    expect_error(result, "other.tum", "stamps of another log")


def test_the_list_of_mappers(call):
    shown = call("mappers").stdout
    assert all(name in shown for name in mapper_names())
    assert "Hossain" in shown
    found = figures(call("mappers", "--json"))
    assert [entry["name"] for entry in found["mappers"]] == list(mapper_names())
    assert all(entry["summary"] and entry["paper"] for entry in found["mappers"])


def test_poses_are_paired_by_line_where_stamps_do_not_tell_the_time(
    corridor, truth_file, call, tmp_path
):
    path, truth = corridor
    asked = ("--mapper", "odometry", "--json")
    expected = figures(call("map", path, "--reference", truth_file, *asked))
    coarse = tmp_path / "coarse.log"
    lines = [line.split() for line in path.read_text().splitlines()]
    for words in lines:
        if words and words[0] == "FLASER":
            words[-3] = "1.13486e+09"
    coarse.write_text("\n".join(map(" ".join, lines)) + "\n")
    found = figures(call("map", coarse, "--reference", truth_file, *asked))
    assert found["ate_rmse_m"] == pytest.approx(expected["ate_rmse_m"])
    clock, paired = found["notes"]
    assert clock.endswith("28 scans share 1 stamp); the scans stay in the file's order")
    assert paired == f"the poses of {truth_file.name} are paired line by line"
    part = tmp_path / "part.tum"
    write_tum(Trajectory(stamps=truth.stamps[1:], poses=truth.poses[1:]), part)
    found = figures(call("map", coarse, "--reference", part, *asked))
    assert found["ate_rmse_m"] is None
    assert "the poses of part.tum are not compared" in found["notes"][1]
