"""The folder of a benchmark: what is written is read back; damaged or foreign files are refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import albot_env
from albot_agents.benchmark.cell import read_episode, single_values
from albot_agents.benchmark.folder import CellResults, ResultsFolder
from albot_core.errors import InputError
from albot_core.plain_data import Location
from tests.agents.benchmark.episodes import cell, results


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    """A folder with three episodes of one cell."""
    folder = ResultsFolder(tmp_path / "results")
    folder.begin()
    folder.write(results(cell(), 3))
    return folder


def test_what_is_written_is_read_back(folder: ResultsFolder) -> None:
    wanted = results(cell(), 3)
    assert folder.read_cell(cell("oracle")) is None
    (found,) = ResultsFolder(folder.path).read()
    assert found.cell == wanted.cell
    assert found.fingerprint is None
    assert [each.to_plain() for each in found.episodes] == [
        each.to_plain() for each in wanted.episodes
    ]
    assert found.episodes[0].agent == "albot1-homing"


def test_episodes_stand_in_the_protocols_order(folder: ResultsFolder) -> None:
    before = folder.file(cell()).read_bytes()
    mixed = results(cell(), 3)
    folder.write(replace(mixed, episodes=mixed.episodes[::-1]))
    assert folder.file(cell()).read_bytes() == before


numbers = st.floats(-1e6, 1e6)


@given(st.lists(numbers, min_size=3, max_size=3), numbers, st.integers(0, 99))
def test_poses_are_kept_to_the_bit(pose: list[float], driven: float, seed: int) -> None:
    (one,) = results(cell(), 1).episodes
    data = json.loads(json.dumps(one.to_plain() | {"start": pose, "driven": driven, "seed": seed}))
    found = read_episode(data, "a", Location("file"))
    assert found.start.tobytes() == np.array(pose).tobytes()
    assert (found.driven, found.seed) == (driven, seed)


def test_only_single_finite_values_are_kept() -> None:
    info = {
        "b": np.float64(1.5),
        "a": np.True_,
        "far": np.inf,
        "pose": np.zeros(3),
        "x": {},
        "s": "t",
    }
    assert single_values(info) == {"a": True, "b": 1.5, "far": None, "s": "t"}


def test_a_new_folder_is_not_made_before_it_begins(tmp_path: Path) -> None:
    assert ResultsFolder(tmp_path / "new").read() == []
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"collisions": 1', '"collisions": "x"', "line 3, collisions: expected a whole number"),
        ('"collisions": 1', '"collisionz": 1', "line 3, collisionz: expected one of"),
        ('"spl": 0.5', '"spl": NaN', "line 2: expected finite numbers"),
        ("70001", "70000", "line 3: expected an episode of the protocol, once, found"),
        ("70001", "5", "line 3: expected an episode of the protocol, once, found random:office:5"),
        ('"protocol": 1', '"protocol": 2', "protocol: expected 1, found another"),
        (f'"{albot_env.__version__}"', '"0.0.9"', "version: expected figures of albot-env"),
        ('"pioneer"', '"poor"', "expected the file of a cell of protocol 1"),
        ('"start": [', '"start": [1.0, ', "line 2, start: expected 3 numbers"),
    ],
)
def test_a_changed_file_is_refused(folder: ResultsFolder, old: str, new: str, said: str) -> None:
    file = folder.file(cell())
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=file.name) as caught:
        folder.read()
    assert said in str(caught.value)


def test_a_torn_file_is_refused_wherever_it_is_torn(folder: ResultsFolder) -> None:
    file = folder.file(cell())
    text = file.read_text()
    ends = {k for k, sign in enumerate(text) if sign == "\n"}
    for length in range(0, len(text), 7):
        file.write_text(text[:length])
        if length in ends or length - 1 in ends:
            # Whole lines are whole episodes: a run adds those that are missing.
            assert len(folder.read()[0].episodes) == text[:length].rstrip().count("\n")
            continue
        with pytest.raises(InputError, match="remove a torn file to measure its cell again"):
            folder.read()


def test_other_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(
        InputError, match=r"expected a new or an empty folder, or one with benchmark\.json"
    ):
        ResultsFolder(tmp_path)


@pytest.mark.parametrize(
    ("manifest", "said"),
    [
        ({"protocol": 9, "version": albot_env.__version__}, "expected a known version: 1, found 9"),
        ({"protocol": 1, "version": "9.0"}, "version: expected figures of albot-env"),
        ({"protocol": "1", "version": "9.0"}, "protocol: expected a whole number"),
        ([], "expected a mapping"),
    ],
)
def test_a_folder_of_another_protocol_or_version_is_refused(
    folder: ResultsFolder, manifest: object, said: str
) -> None:
    (folder.path / "benchmark.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError) as caught:
        ResultsFolder(folder.path)
    assert said in str(caught.value)


def test_a_folder_keeps_to_its_protocol(folder: ResultsFolder) -> None:
    assert ResultsFolder(folder.path, 1).protocol.protocol == 1
    with pytest.raises(InputError, match="expected protocol 7, found 1"):
        ResultsFolder(folder.path, 7)


def test_one_process_writes_at_a_time(folder: ResultsFolder) -> None:
    said = "expected a folder that no other process writes into"
    other = ResultsFolder(folder.path)
    with folder.locked(), pytest.raises(InputError, match=said), other.locked():
        raise AssertionError
    with folder.locked():
        pass


def test_a_cell_of_another_odometer_is_refused(folder: ResultsFolder) -> None:
    folder.write(results(cell(odometer="bias-3"), 1))
    with pytest.raises(InputError, match="expected the file of a cell of protocol 1, found"):
        folder.read()


def test_an_episode_is_kept_once(folder: ResultsFolder) -> None:
    before = folder.file(cell()).read_bytes()
    folder.add(results(cell(), 2))
    assert folder.file(cell()).read_bytes() == before
    folder.add(results(cell(), 4))
    assert len(folder.read()[0].episodes) == 4


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (results(cell(), 2, 0.9), "random:office:70000, seed 70000 that is in "),
        (results(cell(), 2, 0.9), "info.spl 0.5, found another: 0.9"),
        (results(cell(), 2, fingerprint="ab"), "expected the fingerprint None of albot1-homing"),
        (results(cell(), 2, sources="ab"), "expected the sources 0123456789abcdef of albot1-hom"),
    ],
)
def test_other_results_of_an_episode_are_not_added(
    folder: ResultsFolder, other: CellResults, said: str
) -> None:
    before = folder.file(cell()).read_bytes()
    with pytest.raises(InputError, match=r"^there: expected") as caught:
        folder.add(other, "there")
    assert said in str(caught.value)
    assert str(folder.file(cell())) in str(caught.value)
    assert folder.file(cell()).read_bytes() == before


def test_what_a_killed_process_left_is_removed(folder: ResultsFolder) -> None:
    cells = folder.file(cell()).parent
    (folder.path / "agents").mkdir()
    every = (
        cells / ".albot1-homing@albot1.jsonl.x8d0_abc",
        folder.path / "agents" / ".mine-01234567.json.x8d0_abc",
        folder.path / ".benchmark.json.x8d0_abc",
        folder.path / ".costs.json.x8d0_abc",
        folder.path / ".results-mappers.png.x8d0_abc",
    )
    for left in every:
        left.write_text("half")
    assert len(folder.read()) == 1
    with folder.locked():
        assert not any(left.exists() for left in every)


def test_a_folder_that_a_killed_process_had_just_begun_is_begun_again(tmp_path: Path) -> None:
    left = tmp_path / ".benchmark.json.ab12_x9z"
    left.touch()
    folder = ResultsFolder(tmp_path)
    folder.begin()
    with folder.locked():
        assert not left.exists()


def test_what_others_put_there_stays(folder: ResultsFolder) -> None:
    cells = folder.file(cell()).parent
    (cells / ".a.b.c").mkdir()
    (cells / ".a.jsonl.abcdefgh").mkdir()
    (folder.path / "mine").mkdir()
    files = (
        cells / ".my.v2-01234567@albot1.jsonl",
        folder.path / ".benchmark.json.swp",
        folder.path / "mine" / ".benchmark.json.x8d0_abc",
    )
    for file in files:
        file.write_text("mine")
    with folder.locked():
        assert all(file.exists() for file in files)
    with pytest.raises(InputError, match=r"my\.v2"):
        folder.read()
