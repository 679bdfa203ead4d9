"""`albot export`: each format of each kind of file, and what does not fit."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable
from pathlib import Path
from shutil import rmtree
from typing import Any

import networkx as nx
import numpy as np
import pytest
import yaml
from click.testing import Result
from PIL import Image

from albot_cli import completion
from albot_cli.export_formats import FORMATS, MINARI
from albot_cli.export_source import POSES, read_source
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.logs.reader import read_log, read_reference
from albot_core.mappers.map_file import save_map
from albot_core.mappers.registry import make_mapper
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from tests.cli.conftest import expect_error, figures

Call = Callable[..., Result]
FILES = ("episode", "places", "grid", "log")
FITS = {
    "episode": {"tum", "kitti", "geojson", "carmen", "ply", "csv", "ros2", "rerun"},
    "places": {"geojson", "graphml", "g2o", "rerun"},
    "grid": {"tum", "kitti", "geojson", "map_server", "ply", "csv", "rerun"},
    "log": {"tum", "kitti", "geojson", "carmen", "ply", "csv", "ros2", "rerun"},
}
"""The formats that each file can become, besides Minari."""


@pytest.fixture
def source(
    request: pytest.FixtureRequest, corridor: tuple[Path, Trajectory], tmp_path: Path
) -> Callable[[str], Path]:
    """Makes a file of a kind: an episode, a log, a map with places, or one with a grid."""

    def made(kind: str) -> Path:
        if kind == "episode":
            path: Path = request.getfixturevalue("episode_file")
            return path
        if kind == "log":
            return corridor[0]
        mapper = make_mapper({"places": "albot1", "grid": "gmapping"}[kind])
        for reading in read_log(corridor[0]).readings[:12]:
            mapper.update(reading)
        save_map(mapper, tmp_path / f"{kind}.albot")
        return tmp_path / f"{kind}.albot"

    return made


@pytest.mark.parametrize("kind", FILES)
def test_every_pair_fits_or_says_what_would(
    kind: str, source: Callable[[str], Path], call: Call, tmp_path: Path
) -> None:
    path = source(kind)
    out = tmp_path / "out"
    out.mkdir()
    for name, known in FORMATS.items():
        target = out / f"a{known.suffix}"
        result = call("export", path, "--to", name, "--out", target, "--json")
        if name in FITS[kind]:
            (facts,) = figures(result)["files"]
            assert (facts["file"], facts["out"]) == (str(path), str(target))
            assert target.stat().st_size
            if known.is_folder:
                again = read_source(target)
                assert again.log is not None
                assert (again.kind, len(again.log.stamps)) == ("log", _scans(path))
                rmtree(target)
                continue
            names = {target.name, *(f"a{suffix}" for suffix in known.beside)}
        else:
            expect_error(result, path.name, known.needs, "which can become")
            found = str(result.exception).rpartition("which can become ")[2]
            fitting = FITS[kind] | ({MINARI} if kind == "episode" else set())
            assert set(found.split(", ")) == fitting
            names = set()
        assert {each.name for each in out.iterdir()} == names
        for each in out.iterdir():
            each.unlink()


def test_poses_of_an_episode(episode_file: Path, call: Call, tmp_path: Path) -> None:
    moments = list(EpisodeReader(episode_file).moments())
    for pose, name in (("true", "pose"), ("believed", "belief")):
        out = tmp_path / f"{pose}.tum"
        figures(call("export", episode_file, "--to", "tum", "--pose", pose, "--out", out, "--json"))
        found = read_reference(out)
        assert found.stamps.tolist() == [moment.reading.stamp for moment in moments]
        expected = [getattr(moment, name) for moment in moments]
        np.testing.assert_allclose(found.poses, expected, atol=1e-12)
    result = call("export", episode_file, "--to", "tum", "--pose", "corrected")
    expect_error(result, "--pose", "watched.mcap", "true or believed", "corrected")
    default = tmp_path / "default.kitti"
    call("export", episode_file, "--to", "kitti", "--out", default)
    matrices = np.loadtxt(default).reshape(-1, 3, 4)
    assert np.array_equal(matrices[:, :2, 3], [moment.pose[:2] for moment in moments])


def test_points_lie_on_the_walls(episode_file: Path, call: Call, tmp_path: Path) -> None:
    """By the true poses, within the laser's noise of 1 cm; by the beliefs, in the map's frame."""
    from shapely import MultiLineString, points

    header = EpisodeReader(episode_file).header
    walls = MultiLineString([line.reshape(2, 2) for line in header.walls])
    out = tmp_path / "a.csv"
    call("export", episode_file, "--to", "csv", "--out", out)
    seen = np.loadtxt(out, delimiter=",", skiprows=1)
    off = walls.distance(points(seen[:, 1:]))
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.99) < 0.05
    call("export", episode_file, "--to", "csv", "--out", out, "--pose", "believed", "--force")
    believed = np.loadtxt(out, delimiter=",", skiprows=1)
    assert believed.shape == seen.shape
    assert np.median(np.hypot(*(believed - seen)[:, 1:].T)) > 0.1


def test_a_log_written_as_another_log(
    corridor: tuple[Path, Trajectory], call: Call, tmp_path: Path
) -> None:
    call("export", corridor[0], "--to", "carmen", "--out", tmp_path / "again.log.gz")
    ours, theirs = read_log(corridor[0]), read_log(tmp_path / "again.log.gz")
    np.testing.assert_allclose(theirs.odometry, ours.odometry, atol=1e-4)
    call("export", corridor[0], "--to", "geojson", "--out", tmp_path / "a.geojson")
    (path,) = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert path["properties"]["kind"] == "trajectory"
    np.testing.assert_allclose(path["geometry"]["coordinates"], ours.odometry[:, :2], atol=1e-4)


def test_maps_read_back(source: Callable[[str], Path], call: Call, tmp_path: Path) -> None:
    places, grid = source("places"), source("grid")
    call("export", places, "--to", "graphml", "--out", tmp_path / "a.graphml")
    graph = nx.read_graphml(tmp_path / "a.graphml", node_type=int, force_multigraph=True)
    assert graph.number_of_nodes() == len(read_source(places).snapshot.place_graph.nodes) > 0
    call("export", grid, "--to", "map_server", "--out", tmp_path / "a.yaml")
    described = yaml.safe_load((tmp_path / "a.yaml").read_text())
    with Image.open(tmp_path / described["image"]) as picture:
        known = read_source(grid).grid
        assert known is not None
        assert picture.size[::-1] == known.occupancy.shape


def test_many_files_and_their_names(
    corridor: tuple[Path, Trajectory],
    episode_file: Path,
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "out"
    words = ("export", corridor[0], episode_file, "--to", "tum", "--out", out)
    facts = figures(call(*words, "--json"))
    assert [each["kind"] for each in facts["files"]] == ["log", "episode"]
    assert {path.name for path in out.iterdir()} == {"corridor.tum", "watched.tum"}
    expect_error(call(*words), "corridor.tum", "--force")
    twin = tmp_path / "twin"
    twin.mkdir()
    (twin / "corridor.log").write_bytes(corridor[0].read_bytes())
    result = call("export", corridor[0], twin / "corridor.log", "--to", "tum", "--out", tmp_path)
    expect_error(result, "names of their own", "corridor.tum")
    monkeypatch.chdir(tmp_path)
    result = call("export", "corridor.log", "--to", "ply")
    assert result.stdout == "log      corridor.ply\n"
    assert (tmp_path / "corridor.ply").exists()


def test_none_is_written_if_one_fails(
    corridor: tuple[Path, Trajectory], call: Call, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.log"
    bad.write_text("nothing of the kind\n")
    out = tmp_path / "out"
    expect_error(call("export", corridor[0], bad, "--to", "tum", "--out", out), "bad.log")
    assert not out.exists()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.mcap", b"\x89MCAP0\r\n\x01" + b"\xff" * 9, ("a.mcap",)),
        ("a.mcap", b"\x89MCAP0\r\n\x01" + (10 << 30).to_bytes(8, "little"), ("a.mcap",)),
        ("a.albot", b"PK\x03\x04 and no more", ("a.albot", "map file")),
        ("a.log", b"\0\1\2", ("a.log", "a log in one of the formats")),
        ("a.log", b"", ("a.log", "an empty file")),
    ],
)
@pytest.mark.parametrize("target", ["tum", "minari"])
def test_a_damaged_file_is_one_clear_error(
    name: str, content: bytes, words: tuple[str, ...], target: str, call: Call, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    out = tmp_path / "out"
    result = call("export", tmp_path / name, "--to", target, "--out", out)
    expect_error(result, *(words if target == "tum" else words[:1]))
    assert not out.exists()


def test_no_file_a_folder_and_wrong_options(episode_file: Path, call: Call, tmp_path: Path) -> None:
    expect_error(call("export", tmp_path / "no.log", "--to", "tum"), "no.log", "not found")
    expect_error(call("export", tmp_path, "--to", "tum", "--out", tmp_path / "a"), "a folder")
    expect_error(call("export", episode_file, "--to", "g2o", "--pose", "true"), "--pose", "g2o")
    expect_error(call("export", episode_file, "--to", "minari"), "--out", "the id")
    expect_error(call("export", episode_file, "--to", "tum", "--out", ""), "--out", "nothing")
    result = call("export", episode_file, "--to", "tum", "--out", episode_file, "--force")
    expect_error(result, "a file other than FILE")
    expect_error(
        call("export", episode_file, "--to", "map_server", "--out", tmp_path / "a.yml"), ".yaml"
    )


def test_a_bag_takes_one_file_and_an_empty_folder(
    corridor: tuple[Path, Trajectory], call: Call, tmp_path: Path
) -> None:
    words = ("export", corridor[0], "--to", "ros2", "--out")
    expect_error(call(*words, tmp_path), "empty or does not exist")
    expect_error(call("export", *[corridor[0]] * 2, "--to", "ros2"), "FILE", "one at a time")
    call(*words, tmp_path / "bag")
    result = call("export", tmp_path / "bag", "--to", "tum", "--out", tmp_path / "a.tum")
    assert result.exception is None
    assert len(read_reference(tmp_path / "a.tum").stamps) == 28
    result = call("export", corridor[0], "--to", "tum", "--scan", "/scan")
    expect_error(result, "corridor.log", "a ROS bag, as topics are given")


def test_a_torn_episode_says_so(call: Call, tmp_path: Path) -> None:
    """As a process leaves it that is killed: whole chunks, and no end."""
    torn = _explored(tmp_path / "torn.mcap", 25, is_closed=False)
    for name in ("tum", "minari"):
        result = call("export", torn, "--to", name, "--out", tmp_path / name, "--json")
        assert "torn.mcap: never closed, ends early" in result.stderr
    moments = len(read_reference(tmp_path / "tum").stamps)
    assert 1 < moments < 26
    assert figures(result)["steps"] == moments - 1


def test_episodes_become_a_data_set(call: Call, tmp_path: Path) -> None:
    minari = pytest.importorskip("minari", reason="minari is not installed")
    paths = [_explored(tmp_path / f"{seed}.mcap", 4, seed) for seed in (1, 2)]
    out = tmp_path / "set"
    facts = figures(call("export", *paths, "--to", "minari", "--out", out, "--json"))
    assert (facts["id"], facts["episodes"], facts["steps"]) == ("set-v0", 2, 8)
    loaded = minari.load_dataset(facts["load"])
    assert loaded.total_steps == 8
    assert loaded.recover_environment().spec.id == "Albot/Explore-v0"
    expect_error(call("export", *paths, "--to", "minari", "--out", out), "--force")
    result = call("export", paths[0], "--to", "minari", "--out", out, "--force")
    assert result.stdout.startswith("set-v0: 1 episode, 4 steps\n")
    assert minari.load_dataset(facts["load"]).total_episodes == 1


def test_an_evaluation_becomes_a_data_set(call: Call, tmp_path: Path) -> None:
    minari = pytest.importorskip("minari", reason="minari is not installed")
    words = ("evaluate", "explore", "--agent", "random", "--seeds", "3..5", "--steps", "4")
    words += ("--worlds", "square-loop", "--mapper", "none", "--jobs", "1", "--json")
    found = []
    for batch in (1, 2):
        out = tmp_path / str(batch)
        facts = figures(call(*words, "--batch", batch, "--minari", out))
        assert facts["minari"] == {
            "id": f"{batch}-v0",
            "folder": str(out),
            "load": str(out),
            "episodes": 3,
            "steps": 12,
        }
        found.append(minari.load_dataset(str(out)))
    for alone, batched in zip(*found, strict=True):
        for name in ("observations", "actions", "rewards", "terminations", "truncations"):
            one, other = getattr(alone, name), getattr(batched, name)
            assert (one.dtype, one.tobytes()) == (other.dtype, other.tobytes())
    assert found[0].env_spec == found[1].env_spec
    expect_error(call(*words, "--minari", tmp_path / "1"), "--force")
    expect_error(call(*words, "--minari", ""), "--minari", "nothing")
    (tmp_path / "file").touch()
    expect_error(call(*words, "--minari", tmp_path / "file" / "a"), "a folder to write to")


def test_the_completed_names_are_those_of_the_registry() -> None:
    assert (*FORMATS, MINARI) == completion.EXPORTS
    assert completion.POSES == POSES


def test_the_page_tells_all_formats() -> None:
    text = (Path(__file__).parents[2] / "docs" / "exchange.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]*`) \|", text, re.MULTILINE)
    told = itertools.chain(*(re.findall(r"`(\w+)`", row) for row in rows))
    assert {*told} == {*completion.EXPORTS}


def _scans(path: Path) -> int:
    log = read_source(path).log
    return 0 if log is None else len(log.stamps)


def _explored(path: Path, steps: int, seed: int = 1, *, is_closed: bool = True) -> Path:
    import gymnasium

    env = gymnasium.make("Albot/Explore-v0", world="square-loop", mapper="none")
    inside: Any = env.unwrapped
    inside.recorder = EpisodeWriter(path)
    env.reset(seed=seed)
    for k in range(steps):
        env.step(np.array((0.5, 0.2 * np.sin(k), -1.0), np.float32))
    so_far = path.read_bytes()
    env.close()
    if not is_closed:
        path.write_bytes(so_far)
    return path


def test_another_kind_of_archive_is_refused(call: Call, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", numbers=np.zeros(3))
    with pytest.raises(InputError, match="albot-map"):
        read_source(tmp_path / "a.npz")
