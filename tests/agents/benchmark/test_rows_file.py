"""Results in one file: what is written is read back and adds up; whatever else is refused."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import albot_env
from albot_agents.benchmark.costs import add_costs
from albot_agents.benchmark.entrant import find_entrant
from albot_agents.benchmark.folder import CellResults, ResultsFolder
from albot_agents.benchmark.rows_file import Results, merge, read_results, write_rows
from albot_core.errors import InputError
from tests.agents.benchmark.episodes import PROTOCOL, cell, results

CELLS = (cell(), cell("oracle", mapper="none"), cell(worlds="mazes", odometer="poor"))


def folder_of(path: Path, *found: CellResults) -> ResultsFolder:
    """A folder with results, a trained agent and costs."""
    folder = ResultsFolder(path)
    folder.begin()
    for each in found:
        folder.write(each)
    folder.write_agent(find_entrant("homing"))
    add_costs(path, {"odometry": 1.0, "albot1": 6.25})
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    return folder_of(tmp_path / "results", *(results(each, 4) for each in CELLS))


@pytest.fixture
def file(folder: ResultsFolder, tmp_path: Path) -> Path:
    """The rows of `folder`."""
    path = tmp_path / "rows.jsonl.gz"
    write_rows(Results.of(folder), PROTOCOL, path)
    return path


def content(folder: Path) -> dict[str, bytes]:
    """The bytes of all files of a folder."""
    return {
        str(each.relative_to(folder)): each.read_bytes()
        for each in sorted(folder.rglob("*"))
        if each.is_file()
    }


def test_a_folder_made_of_a_file_is_the_same_to_the_byte(
    folder: ResultsFolder, file: Path, tmp_path: Path
) -> None:
    other = ResultsFolder(tmp_path / "other")
    read_results(file, PROTOCOL).write(other)
    assert content(other.path) == content(folder.path)


def test_the_same_results_give_the_same_bytes_without_a_time(
    folder: ResultsFolder, file: Path, tmp_path: Path
) -> None:
    again = tmp_path / "another-name.jsonl.gz"
    write_rows(read_results(file, PROTOCOL), PROTOCOL, again)
    assert again.read_bytes() == file.read_bytes()
    assert file.read_bytes()[3:8] == bytes(5)  # Neither a name (flags) nor a time.


def test_a_row_carries_what_determines_it(file: Path) -> None:
    first, *rows = map(json.loads, gzip.decompress(file.read_bytes()).splitlines())
    assert (first["protocol"], first["digest"]) == (1, PROTOCOL.digest)
    assert (first["version"], first["episodes"]) == (albot_env.__version__, 12)
    assert first["agents"]["homing"]["plan"].startswith("# A training plan for")
    assert len(rows) == 12
    one = rows[0]
    assert (one["task"], one["agent"], one["mapper"]) == (
        "Albot/Homing-v0",
        "albot1-homing",
        "albot1",
    )
    assert (one["world"], one["seed"]) == ("random:office:70000", 70000)
    assert (one["fingerprint"], one["sources"]) == (None, "0123456789abcdef")


@given(st.lists(st.integers(0, 3), min_size=8, max_size=8))
def test_parts_add_up_to_the_whole_in_any_order(
    tmp_path_factory: pytest.TempPathFactory, owners: list[int]
) -> None:
    """Episodes are divided among three machines; those of number 3 were run by all."""
    whole = results(cell(), 8)
    base = tmp_path_factory.mktemp("parts")
    parts = []
    for number in range(3):
        some = [
            one for one, owner in zip(whole.episodes, owners, strict=True) if owner in (number, 3)
        ]
        source = base / f"{number}"
        cells = {cell(): replace(whole, episodes=some)} if some else {}
        parts.append(Results(source=source, cells=cells, costs={"albot1": 2.0}))
    wanted = {(one.world, one.seed): one.to_plain() for one in whole.episodes}
    for order in ((0, 1, 2), (2, 0, 1)):
        together = merge([parts[k] for k in order])
        out = ResultsFolder(base / f"out{order[0]}")
        together.write(out)
        (found,) = out.read()
        assert {(one.world, one.seed): one.to_plain() for one in found.episodes} == wanted
    assert content(base / "out0") == content(base / "out2")


def test_of_costs_the_first_stand() -> None:
    here, there = Path("here"), Path("there")
    first = Results(source=here, cells={}, costs={"albot1": 2.0})
    other = Results(source=there, cells={}, costs={"albot1": 3.0, "ratslam": 9.0})
    assert merge([first, other]).costs == {"albot1": 2.0, "ratslam": 9.0}


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (results(cell(), 2, 0.9), "random:office:70000, seed 70000 that is in here: info.spl 0.5"),
        (results(cell(), 1, sources="ab"), "the sources 0123456789abcdef of albot1-homing"),
        (results(cell(), 1, fingerprint="ab"), "the fingerprint None of albot1-homing"),
    ],
)
def test_two_results_of_an_episode_never_mix(other: CellResults, said: str) -> None:
    mine = Results(source=Path("here"), cells={cell(): results(cell(), 4)})
    theirs = Results(source=Path("there"), cells={cell(): other})
    with pytest.raises(InputError, match=r"^there: expected .* in here") as caught:
        merge([mine, theirs])
    assert said in str(caught.value)


def test_two_trainings_of_one_name_never_mix(folder: ResultsFolder) -> None:
    mine = Results.of(folder)
    record = mine.agents["homing"]
    changed = replace(record, facts={**record.facts, "samples": 1})
    theirs = replace(mine, source=Path("there"), agents={"homing": changed})
    with pytest.raises(InputError, match="there: expected the training of homing that is in"):
        merge([mine, theirs])


HEADER: dict[str, tuple[Any, str]] = {
    "protocol": (2, "line 1, protocol: expected results of protocol 1, protocol 1, found 2"),
    "digest": ("0" * 16, "line 1, digest: expected results of protocol 1, digest "),
    "version": ("0.0.9", "version: expected figures of albot-env"),
    "episodes": (13, "expected 13 episodes, a line each, found 12: the file is torn"),
    "costs": ({"albot1": "dear"}, "line 1, costs.albot1: expected a number"),
    "agents": ({"../homing": {}}, "line 1, agents.../homing: expected a name that a file can have"),
}
ROW: dict[str, tuple[Any, str]] = {
    "seed": (70001, "line 3: expected an episode of the protocol, once, found"),
    "world": ("random:office:5", "line 2: expected an episode of the protocol, once, found"),
    "spl": (1, "line 2, spl: expected one of"),
    "task": ("Albot/Walk-v0", "line 2: expected a cell of protocol 1, found Albot/Walk-v0"),
    "odometer": ("bias-3", "line 2: expected a cell of protocol 1"),
    "agent": ("../mine", "line 2, agent: expected a name that a file can have"),
    "mapper": ("", "line 2, mapper: expected a name that a file can have"),
    "sources": ("ab", "line 3, sources: expected ab, as in line 2, found 0123456789abcdef"),
    "fingerprint": ("ab", "line 3, fingerprint: expected ab, as in line 2, found None"),
    "start": ([1, 2], "line 2, start: expected 3 numbers"),
    "steps": (None, "line 2, steps: expected a whole number"),
}


@pytest.mark.parametrize(
    ("line", "name", "value", "said"),
    [
        *((0, name, value, said) for name, (value, said) in HEADER.items()),
        *((1, name, value, said) for name, (value, said) in ROW.items()),
    ],
)
def test_another_file_is_refused(file: Path, line: int, name: str, value: Any, said: str) -> None:
    lines = gzip.decompress(file.read_bytes()).decode().splitlines()
    lines[line] = json.dumps(json.loads(lines[line]) | {name: value})
    if name == "seed":  # The first episode is the second one, twice.
        lines[line] = lines[2]
    file.write_bytes(gzip.compress("\n".join(lines).encode()))
    with pytest.raises(InputError, match=file.name) as caught:
        read_results(file, PROTOCOL)
    assert said in str(caught.value)


def test_a_torn_file_is_refused_wherever_it_is_torn(file: Path) -> None:
    packed = file.read_bytes()
    for length in range(0, len(packed), 97):
        file.write_bytes(packed[:length])
        with pytest.raises(InputError, match=file.name):
            read_results(file, PROTOCOL)
    text = gzip.decompress(packed)
    for end in [k for k, sign in enumerate(text[:-1]) if sign == ord("\n")]:
        file.write_bytes(gzip.compress(text[:end]))
        with pytest.raises(InputError, match="the file is torn"):
            read_results(file, PROTOCOL)


def test_another_folder_is_refused(folder: ResultsFolder, tmp_path: Path) -> None:
    assert read_results(folder.path, PROTOCOL).costs == {"odometry": 1.0, "albot1": 6.25}
    with pytest.raises(InputError, match=r"expected a folder of results, with benchmark\.json"):
        read_results(tmp_path, PROTOCOL)
