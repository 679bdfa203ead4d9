"""`albot map` and `albot mappers`, as they are called."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

import albot_cli.map_files
from albot_cli.main import albot
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.geometry.poses import compose
from albot_core.logs.reference import read_reference
from albot_core.logs.tum import write_tum
from albot_core.mapfile import load_map
from albot_core.registry import mapper_names

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
FILES = {"trajectory.tum", "surfaces.geojson", "map.png", "map.albot"}
PLACES = {"network.graphml", "events.txt"}
"""The files of a mapper that knows places besides."""

WIDTH, LENGTH = 2.0, 14.0
"""A corridor from (0, -1) to (14, 1), with a niche in its left wall (m)."""


def corridor_ranges(x: float, y: float, heading: float) -> np.ndarray:
    """What 180 beams meet in the corridor; the slow way, wall by wall."""
    walls = [
        (0, -1, 14, -1),
        (14, -1, 14, 1),
        (14, 1, 8, 1),
        (8, 1, 8, 1.6),
        (8, 1.6, 6, 1.6),
        (6, 1.6, 6, 1),
        (6, 1, 0, 1),
        (0, 1, 0, -1),
    ]
    angles = heading + np.deg2rad(np.arange(-90, 90))
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    nearest = np.full(180, 40.0)
    for x1, y1, x2, y2 in walls:
        run = np.array((x2 - x1, y2 - y1), np.float64)
        offset = np.array((x1 - x, y1 - y))
        across = directions[:, 0] * run[1] - directions[:, 1] * run[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (offset[0] * run[1] - offset[1] * run[0]) / across
            part = (offset[0] * directions[:, 1] - offset[1] * directions[:, 0]) / across
        hit = (reach > 0) & (part >= 0) & (part <= 1)
        nearest[hit] = np.minimum(nearest[hit], reach[hit])
    return nearest


@pytest.fixture
def corridor(tmp_path: Path) -> tuple[Path, Trajectory]:
    """A log of a drive along the corridor, its odometer 4 % short, and where it truly went."""
    truth, odometry, lines = np.array((1.0, 0, 0)), np.array((1.0, 0, 0)), []
    poses = []
    for k in range(28):
        step = np.array((0.4, 0, 0.02 * np.cos(k)))
        if k:
            truth, odometry = compose(truth, step), compose(odometry, step * (0.96, 1, 1.3))
        poses.append(truth)
        ranges = " ".join(f"{r:.3f}" for r in corridor_ranges(*truth))
        pose = " ".join(f"{value:.6f}" for value in odometry)
        lines.append(f"FLASER 180 {ranges} {pose} {pose} {k}.5 robot {k}.5")
    path = tmp_path / "corridor.log"
    path.write_text("\n".join(lines) + "\n")
    return path, Trajectory(stamps=np.arange(28) + 0.5, poses=np.stack(poses))


@pytest.fixture
def truth_file(corridor: tuple[Path, Trajectory]) -> Path:
    path = corridor[0].with_name("truth.tum")
    write_tum(corridor[1], path)
    return path


@pytest.fixture
def call() -> Callable[..., Result]:
    """Calls `albot` with arguments; errors of input come out as they are."""
    return lambda *arguments: CliRunner().invoke(
        albot, [str(argument) for argument in arguments], standalone_mode=False
    )


def figures(result: Result) -> dict[str, Any]:
    assert result.exception is None, result.exception
    parsed = json.loads(result.stdout)
    assert isinstance(parsed, dict)
    return parsed


@pytest.mark.parametrize("mapper", mapper_names())
def test_what_json_holds(mapper, corridor, call):
    told = figures(call("map", corridor[0], "--mapper", mapper, "--json"))
    assert told.keys() >= KEYS
    assert told["log"] == "corridor.log"
    assert told["mapper"] == mapper
    assert told["scans"] == 28
    assert told["path_m"] == pytest.approx(0.96 * 0.4 * 27, abs=0.01)
    assert told["updates"] >= 1
    assert told["surfaces"] >= 3
    assert told["seconds"] > 0
    assert told["scans_per_second"] == pytest.approx(28 / told["seconds"])
    assert told["places"] == (None if mapper in ("odometry", "none") else 1)
    unknown = ("ate_rmse_m", "odometry_ate_rmse_m", "relations", "files", "left_out")
    assert all(told[key] is None for key in unknown)


def test_the_default_mapper_is_albot1(corridor, call):
    assert figures(call("map", corridor[0], "--json"))["mapper"] == "albot1"


def test_the_errors_against_a_reference(corridor, truth_file, call):
    told = figures(
        call("map", corridor[0], "--mapper", "odometry", "--reference", truth_file, "--json")
    )
    assert told["odometry_ate_rmse_m"] == pytest.approx(told["ate_rmse_m"])
    # 4 % short along 10.8 m: ± 0.216 m at the ends once aligned, its rms that over √3.
    assert told["ate_rmse_m"] == pytest.approx(0.216 / np.sqrt(3), rel=0.15)


def test_the_errors_against_relations(corridor, call):
    path, _ = corridor
    relations = path.with_name("true.relations")
    relations.write_text("0.5 1.5 0.4 0 0 0 0 0\n1.5 2.5 0.4 0 0 0 0 0\n77 88 0 0 0 0 0 0\n")
    told = figures(call("map", path, "--mapper", "odometry", "--relations", relations, "--json"))
    assert told["relations"].keys() == RELATION_KEYS
    assert told["relations"]["count"] == 2
    assert told["relations"]["translation_mean_m"] == pytest.approx(0.016, abs=1e-4)
    turns = np.rad2deg([1.3 * 0.02 * np.cos(k) for k in (1, 2)])
    assert told["relations"]["rotation_mean_deg"] == pytest.approx(np.abs(turns).mean(), abs=1e-3)


def test_the_table_shows_the_odometer_beside_the_mapper(corridor, truth_file, call):
    result = call("map", corridor[0], "--mapper", "odometry", "--reference", truth_file)
    lines = result.stdout.splitlines()
    assert lines[0].startswith("corridor.log: 28 scans along 10.4 m")
    header, error, entropy = lines[-3:]
    assert header.split() == ["odometry", "odometer"]
    assert re.fullmatch(r"trajectory error, ATE rmse +(0\.1\d m) +\1", error)
    assert re.fullmatch(r"map entropy, less is crisper +(-\d\.\d\d) +\1", entropy)


def test_recognition_is_measured_where_the_truth_is_known(corridor, truth_file, call, tmp_path):
    asked = ("map", corridor[0], "--reference", truth_file, "--recognition")
    told = figures(call(*asked, "--out", tmp_path / "out", "--json"))["recognition"]
    assert (tmp_path / "out" / "recognition.png").read_bytes().startswith(b"\x89PNG")
    # A corridor once along: nothing is seen twice, and whatever is claimed is a false alarm.
    assert told["queries"] == 0
    assert told["recall"] == {"1.00": 0.0, "0.99": 0.0, "0.95": 0.0}
    assert "recognised of 0 places seen before" in call(*asked).stdout
    expect_error(call("map", corridor[0], "--recognition"), "--recognition", "a reference")


def test_the_files(corridor, truth_file, call, tmp_path):
    out = tmp_path / "new" / "out"
    told = figures(call("map", corridor[0], "--reference", truth_file, "--out", out, "--json"))
    assert {path.name for path in out.iterdir()} == FILES | PLACES
    assert {Path(path) for path in told["files"].values()} == set(out.iterdir())
    assert list(out.parent.iterdir()) == [out]
    mapper = load_map(out / "map.albot")
    assert (mapper.name, mapper.updates) == ("albot1", told["updates"])
    believed = read_reference(out / "trajectory.tum")
    np.testing.assert_array_equal(believed.stamps, corridor[1].stamps)
    np.testing.assert_allclose(believed.poses[-1], mapper.pose, atol=1e-9)
    features = json.loads((out / "surfaces.geojson").read_text())["features"]
    assert sum("kind" not in feature["properties"] for feature in features) == told["surfaces"]
    assert sum("kind" in feature["properties"] for feature in features) == told["places"] == 1
    assert (out / "events.txt").read_text() == "view 1: set out in P1\n"
    assert list(nx.read_graphml(out / "network.graphml").nodes) == ["0"]
    with Image.open(out / "map.png") as picture:
        assert picture.format == "PNG"


def test_a_mapper_without_places_leaves_no_files_of_places(corridor, call, tmp_path):
    told = figures(
        call("map", corridor[0], "--mapper", "odometry", "--out", tmp_path / "a", "--json")
    )
    assert {path.name for path in (tmp_path / "a").iterdir()} == FILES
    assert set(told["files"]) == {"trajectory", "surfaces", "picture", "map"}


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
    call("map", corridor[0], "--out", out)
    assert {path.name for path in out.iterdir()} == FILES | PLACES | {"notes.txt"}
    assert (out / "map.png").read_bytes().startswith(b"\x89PNG")


def test_all_files_or_none(corridor, call, tmp_path, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(albot_cli.map_files, "write_picture", fail)
    result = call("map", corridor[0], "--out", tmp_path / "out")
    assert result.exception is not None
    assert [path.name for path in tmp_path.iterdir()] == ["corridor.log"]


def expect_error(result: Result, *words: str) -> None:
    assert isinstance(result.exception, InputError)
    for word in words:
        assert word in str(result.exception)


def test_bad_input_is_named(corridor, truth_file, call, tmp_path):
    path = corridor[0]
    expect_error(call("map", tmp_path / "none.log"), "none.log", "a file that exists")
    expect_error(call("map", path, "--mapper", "albt1"), "did you mean albot1?")
    expect_error(call("map", path, "--reference", path), "corrected poses")
    expect_error(call("map", path, "--relations", path), "line 1", "eight finite numbers")
    expect_error(call("map", path, "--out", truth_file), "a folder to write to")
    expect_error(call("map", path, "--out", truth_file / "out"), "a folder to write to")


def test_a_folder_is_filled_and_nothing_around_it_touched(corridor, call, tmp_path, monkeypatch):
    out = tmp_path / "around" / "out"
    out.mkdir(parents=True)
    around = []
    draw = albot_cli.map_files.write_picture

    def draw_and_look(*arguments: object, **named: Any) -> None:
        around.extend(out.parent.iterdir())
        draw(*arguments, **named)

    monkeypatch.setattr(albot_cli.map_files, "write_picture", draw_and_look)
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


def test_a_torn_log_and_its_good_beginning(corridor, call, tmp_path):
    path = tmp_path / "torn.log"
    lines = corridor[0].read_text().splitlines()
    path.write_text("\n".join([*lines[:20], lines[20][:300], *lines[21:23]]))
    expect_error(call("map", path), "torn.log, line 21: expected")
    told = figures(call("map", path, "--keep-going", "--json"))
    assert told["scans"] == 20
    assert told["left_out"]["lines"] == 3
    assert told["left_out"]["scans"] == 3
    assert "line 21" in told["left_out"]["reason"]
    shown = call("map", path, "--keep-going").stdout
    assert "left out: 3 lines, 3 scans" in shown


def test_the_list_of_mappers(call):
    shown = call("mappers").stdout
    assert all(name in shown for name in mapper_names())
    assert "Hossain" in shown
    told = figures(call("mappers", "--json"))
    assert [entry["name"] for entry in told["mappers"]] == list(mapper_names())
    assert all(entry["summary"] and entry["paper"] for entry in told["mappers"])


ALBOT = (sys.executable, "-c", "from albot_cli.main import main; main()")


def test_one_line_and_status_2_for_bad_input(corridor, tmp_path):
    path = tmp_path / "torn.log"
    path.write_text(corridor[0].read_text()[:5000])
    out = tmp_path / "out"
    done = subprocess.run(
        [*ALBOT, "map", path, "--out", out, "--json"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"albot: {path}, line ")
    assert not out.exists()


def test_json_alone_on_stdout_and_nothing_on_a_quiet_stderr(corridor):
    done = subprocess.run(
        [*ALBOT, "map", corridor[0], "--json"], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout)["scans"] == 28
    assert done.stderr == ""


def test_a_progress_bar_on_a_terminal(corridor):
    main, terminal = pty.openpty()
    with subprocess.Popen(
        [*ALBOT, "map", corridor[0], "--json"], stdout=subprocess.PIPE, stderr=terminal
    ) as process:
        os.close(terminal)
        shown = _read_all(main)
        assert process.stdout is not None
        assert json.loads(process.stdout.read())["scans"] == 28
    assert process.returncode == 0
    assert b"albot1 on corridor.log" in shown


def _read_all(terminal: int) -> bytes:
    shown = b""
    try:
        while piece := os.read(terminal, 4096):
            shown += piece
    except OSError:
        pass
    os.close(terminal)
    return shown


def test_stopping_leaves_nothing_half_written(corridor, tmp_path):
    # The signal comes when three of the four files are written.
    code = (
        "import os, signal, albot_cli.map_files as files\n"
        "from albot_cli.main import main\n"
        "files.write_picture = lambda *_, **__: os.kill(os.getpid(), signal.SIGINT)\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "map", corridor[0], "--out", tmp_path / "out"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert done.stderr.strip() == "albot: stopped"
    assert list(tmp_path.iterdir()) == [corridor[0]]


@pytest.mark.parametrize(
    ("name", "odometry", "limit"),
    [
        ("intel_raw.json.gz", 24.0, 4.0),
        ("aces-corrected.log.gz", 5.4, 5.0),
        ("freiburg-101-corrected.log.gz", 8.6, 2.0),
    ],
)
def test_albot1_betters_the_odometer_on_real_logs(name, odometry, limit, call, data):
    logs = data / "logs"
    intel = [
        "--reference",
        logs / "intel_reference.json.gz",
        "--relations",
        logs / "intel.relations",
    ]
    told = figures(call("map", logs / name, *(intel if "intel" in name else []), "--json"))
    assert told["odometry_ate_rmse_m"] == pytest.approx(odometry, abs=0.1)
    assert told["ate_rmse_m"] < limit
    if "intel" in name:
        assert told["relations"]["count"] == 90
        assert told["relations"]["translation_mean_m"] < 1.0


@pytest.mark.parametrize(
    ("name", "scans"),
    [("wean_robotdata1.log.xz", 713), ("wean_robotdata2.log.xz", 2251), ("duke_loop5.log.xz", 551)],
)
def test_raw_logs_without_a_reference(name, scans, call, data, tmp_path):
    told = figures(call("map", data / "logs" / name, "--out", tmp_path / "out", "--json"))
    assert told["scans"] == scans
    assert told["ate_rmse_m"] is None
    assert told["map_entropy"] < told["odometry_map_entropy"] - 0.1
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES | PLACES
