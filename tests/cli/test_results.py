"""`albot results`: what it runs, what it writes, and what it refuses before it writes anything."""

from __future__ import annotations

import gzip
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result

from albot_agents.benchmark.folder import ResultsFolder
from albot_agents.benchmark.protocol import Protocol, find_protocol
from albot_agents.engine import choice
from albot_agents.trained.trained_agent import shipped_agents
from albot_core.errors import InputError
from tests.cli.conftest import expect_error, figures
from tests.inline_engine import InlineEngine, stopping_after

EXPLORE = ("--task", "explore", "--worlds", "mazes", "--odometer", "pioneer")
RANDOM = (*EXPLORE, "--agent", "random")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes are of ten steps, and run in this process."""

    def find(version: int) -> Protocol:
        protocol = find_protocol(version)
        tasks = {task: replace(each, steps=10) for task, each in protocol.tasks.items()}
        return replace(protocol, tasks=tasks)

    monkeypatch.setattr("albot_agents.benchmark.folder.find_protocol", find)
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: InlineEngine())


def test_what_is_missing_is_run_and_the_page_is_of_all(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    out = tmp_path / "results"
    first = figures(call("results", "--out", out, *RANDOM, "--episodes", 1, "--json"))
    assert first["missing"] == 0
    assert first["stopped"] is False
    assert [(row["agent"], row["episodes"]) for row in first["rows"]] == [("random", 1)]
    agents = ("--agent", "gap-explorer", "--agent", "random")
    both = figures(call("results", "--out", out, *EXPLORE, *agents, "--episodes", 2, "--json"))
    assert [row["episodes"] for row in both["rows"]] == [2, 2]
    assert both["rows"][1]["difference"]["episodes"] == 2
    page = (out / "results.md").read_text()
    assert "`gap-explorer`" in page
    assert "`random`" in page
    data = json.loads((out / "results.json").read_text())
    assert data["rows"] == both["rows"]


def test_a_file_is_scored_in_its_own_task_and_its_lines_are_told(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    file = tmp_path / "mine.albot"
    file.write_bytes(shipped_agents()["exploring"].read_bytes())
    out = tmp_path / "results"
    where = ("--worlds", "mazes", "--odometer", "pioneer", "--episodes", 1)
    result = call("results", "--out", out, "--agent", file, *where)
    assert result.exception is None
    lines = [line for line in result.stdout.splitlines() if "`mine-" in line]
    assert lines[0].startswith("| `mine-")
    assert "| 10 M |" in lines[0]
    assert lines[1].startswith("| mazes | pioneer | `mine-")
    assert {found.cell.task for found in ResultsFolder(out).read()} == {"Albot/Explore-v0"}
    assert "1 of 100 episodes a cell" in result.stdout
    assert "complete" not in result.stdout


def test_the_page_alone(tmp_path: Path, call: Callable[..., Result]) -> None:
    out, page = tmp_path / "results", tmp_path / "page.md"
    call("results", "--out", out, *RANDOM, "--episodes", 1)
    assert "](" not in (out / "results.md").read_text()  # Nothing to link lies there.
    (out / "results.md").unlink()
    (tmp_path / "benchmark.md").touch()
    found = figures(call("results", "--out", out, "--episodes", 0, "--page", page, "--json"))
    assert found["files"] == {"page": str(page), "figures": str(tmp_path / "page.json")}
    assert "`random`" in page.read_text()
    assert "[benchmark.md](benchmark.md)" in page.read_text()
    assert not (out / "results.md").exists()


BOTH = (*EXPLORE, "--agent", "gap-explorer", "--agent", "random", "--json")


def test_runs_of_several_machines_add_up_to_one(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    """The page of a run of all is that of two parts of it, by files or folders, to the byte."""
    whole, first, second = (tmp_path / name for name in ("whole", "first", "second"))
    call("results", "--out", whole, *BOTH, "--episodes", 3)
    call("results", "--out", first, *RANDOM, "--episodes", 3)
    part = tmp_path / "part.jsonl.gz"
    run = ("results", "--out", second, *BOTH, "--episodes", 2, "--rows", part)
    assert figures(call(*run))["files"]["rows"] == str(part)
    merged, rows = tmp_path / "merged", tmp_path / "rows.jsonl.gz"
    found = figures(
        call("results", "--out", merged, "--from", part, "--from", first, *BOTH,
             "--episodes", 3, "--rows", rows)
    )  # fmt: skip
    assert found["missing"] == 0
    assert [row["episodes"] for row in found["rows"]] == [3, 3]
    # Only the third episode of the explorer was run here.
    timed = json.loads((merged / "times.json").read_text())["cells"]
    assert {name: each["episodes"] for name, each in timed.items()} == {
        "explore-v0/mazes/pioneer/gap-explorer@albot1": 1
    }
    again = tmp_path / "again"
    call("results", "--out", again, "--from", rows, "--episodes", 0)
    for name in ("results.md", "results.json"):
        assert (merged / name).read_bytes() == (whole / name).read_bytes()
        assert (again / name).read_bytes() == (whole / name).read_bytes()
    call("results", "--out", whole, "--episodes", 0, "--rows", tmp_path / "whole.jsonl.gz")
    assert (tmp_path / "whole.jsonl.gz").read_bytes() == rows.read_bytes()


def test_a_file_that_contradicts_the_folder_is_refused_before_anything_is_written(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    out, rows = tmp_path / "results", tmp_path / "rows.jsonl.gz"
    call("results", "--out", out, *RANDOM, "--episodes", 2, "--rows", rows)
    text = gzip.decompress(rows.read_bytes()).decode()
    changes = {
        "result": (text.replace('"steps":10', '"steps":11', 1), "expected the result of random"),
        "twice": ("\n".join([*text.splitlines()[:2], text.splitlines()[1]]), "once, found"),
        "protocol": (text.replace('"protocol":1', '"protocol":2'), "results of protocol 1"),
        "version": (text.replace('"version":"', '"version":"9'), "figures of albot-env"),
        "torn": (text[:-9], "valid JSON"),
    }
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for name, (changed, said) in changes.items():
        file = tmp_path / f"{name}.jsonl.gz"
        file.write_bytes(gzip.compress(changed.encode()))
        words = ("--from", file, *RANDOM, "--episodes", 3)
        expect_error(call("results", "--out", out, *words), said, file.name)
        assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
        if name != "result":
            expect_error(call("results", "--out", tmp_path / "new", *words), said)
            assert not (tmp_path / "new").exists()


def _edited(rows: Path, **values: object) -> None:
    """Put other values in each episode of a file of rows."""
    first, *lines = map(json.loads, gzip.decompress(rows.read_bytes()).splitlines())
    lines = [line | values for line in lines]
    rows.write_bytes(gzip.compress("\n".join(map(json.dumps, [first, *lines])).encode()))


def test_rows_of_other_sources_are_shown_but_not_added_to(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    out, rows = tmp_path / "results", tmp_path / "rows.jsonl.gz"
    call("results", "--out", out, *RANDOM, "--episodes", 2, "--rows", rows)
    _edited(rows, sources="0123456789abcdef")
    new = tmp_path / "new"
    result = call("results", "--out", new, "--from", rows, *RANDOM, "--episodes", 3)
    expect_error(result, "expected results of the installed sources of random", rows.name)
    assert not new.exists()
    call("results", "--out", new, "--from", rows, "--episodes", 0)
    assert "**Of other sources:** 1 cells" in (new / "results.md").read_text()


def test_what_is_the_same_when_run_again_becomes_of_the_installed_sources(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    out, rows = tmp_path / "results", tmp_path / "rows.jsonl.gz"
    call("results", "--out", out, *RANDOM, "--episodes", 2, "--rows", rows)
    before = ResultsFolder(out).file(next(iter(ResultsFolder(out).read())).cell).read_bytes()
    for path, adopted in ((rows, 0), (tmp_path / "others.jsonl.gz", 1)):
        path.write_bytes(rows.read_bytes())
        if adopted:
            _edited(path, sources="0123456789abcdef")
        new = tmp_path / f"new-{adopted}"
        result = call("results", "--out", new, "--from", path, *RANDOM, "--check", 3, "--json")
        assert result.return_value == 0
        found = figures(result)
        assert (found["same"], found["differences"], found["adopted"]) == (2, [], adopted)
        assert found["missing"] == 0
        (cell,) = (each.cell for each in ResultsFolder(new).read())
        assert ResultsFolder(new).file(cell).read_bytes() == before
        assert "Of other sources" not in (new / "results.md").read_text()
    said = call("results", "--out", new, *RANDOM, "--check", 1).stdout
    assert "1 episode the same, 0 others; 0 cells now of the installed sources" in said
    assert figures(call("results", "--out", new, *RANDOM, "--episodes", 3, "--json"))["rows"]


def test_what_differs_when_run_again_is_told_and_stays_of_other_sources(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    out, rows = tmp_path / "results", tmp_path / "rows.jsonl.gz"
    call("results", "--out", out, *RANDOM, "--episodes", 2, "--rows", rows)
    _edited(rows, sources="0123456789abcdef", steps=11)
    new = tmp_path / "new"
    result = call("results", "--out", new, "--from", rows, *RANDOM, "--check", 1)
    assert result.return_value == 1
    assert "0 episodes the same, 1 other; 0 cells now" in result.stdout
    assert (
        "differs: random with the mapper none in Albot/Explore-v0, mazes, pioneer, "
        "random:maze:70000, seed 70000: steps 11, now 10" in result.stdout
    )
    (found,) = ResultsFolder(new).read()
    assert found.sources == "0123456789abcdef"
    assert [each.steps for each in found.episodes] == [11, 11]
    assert "**Of other sources:** 1 cells" in (new / "results.md").read_text()
    result = call("results", "--out", new, *RANDOM, "--check", 1, "--json")
    (difference,) = figures(result)["differences"]
    assert (difference["value"], difference["kept"], difference["found"]) == ("steps", 11, 10)
    assert difference["worlds"] == "mazes"


def test_a_check_that_was_stopped_changes_no_cell(
    tmp_path: Path, call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, rows = tmp_path / "results", tmp_path / "rows.jsonl.gz"
    call("results", "--out", out, *RANDOM, "--episodes", 3, "--rows", rows)
    _edited(rows, sources="0123456789abcdef")
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: stopping_after(2))
    new = tmp_path / "new"
    result = call("results", "--out", new, "--from", rows, *RANDOM, "--check", 3, "--json")
    assert result.return_value == 130
    found = figures(result)
    assert (found["same"], found["missing"], found["adopted"]) == (2, 1, 0)
    assert {each.sources for each in ResultsFolder(new).read()} == {"0123456789abcdef"}


def test_a_check_is_of_what_the_folder_has(tmp_path: Path, call: Callable[..., Result]) -> None:
    out = tmp_path / "results"
    expect_error(
        call("results", "--out", out, *RANDOM, "--check", 1),
        f"--check: expected results of these rows in {out}, found none",
    )
    assert not out.exists()
    call("results", "--out", out, *RANDOM, "--episodes", 1)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for words, said in (
        ((*RANDOM, "--check", 1, "--episodes", 1), "--episodes: expected no such option with --c"),
        ((*RANDOM, "--check", 101), "--check: expected 100 at most, the protocol's, found 101"),
        ((*EXPLORE, "--agent", "gap-explorer", "--check", 1), "--check: expected results of the"),
    ):
        expect_error(call("results", "--out", out, *words), said)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_the_time_of_a_row_is_told(tmp_path: Path, call: Callable[..., Result]) -> None:
    out = tmp_path / "results"
    (time_,) = figures(call("results", "--out", out, *RANDOM, "--episodes", 2, "--json"))["times"]
    spent = json.loads((out / "times.json").read_text())["cells"]
    assert spent["explore-v0/mazes/pioneer/random@none"]["episodes"] == 2
    seconds = spent["explore-v0/mazes/pioneer/random@none"]["seconds"]
    assert seconds > 0
    assert time_["seconds"] == pytest.approx(50 * seconds)
    assert (time_["episodes"], time_["slowest"]) == (100, "mazes, pioneer")
    said = call("results", "--out", out, *RANDOM, "--episodes", 2).stdout
    assert "Albot/Explore-v0 random (none): the 100 episodes of 1 cells take" in said


def test_ctrl_c_leaves_a_page_and_the_status_of_a_stopped_command(
    tmp_path: Path, call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: stopping_after(1))
    out = tmp_path / "results"
    result = call("results", "--out", out, *RANDOM, "--episodes", 3, "--json")
    assert result.return_value == 130
    assert figures(result)["stopped"] is True
    assert figures(result)["missing"] == 2
    assert "`random`" in (out / "results.md").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--task", "homin"), "did you mean homing"),
        (("--task", "homing-revealed"), "--task: expected one of Albot/Homing-v0, "),
        (("--worlds", "office"), "--worlds: expected one of offices, "),
        (("--worlds", "office"), "(did you mean offices?)"),
        (("--odometer", "bias-3"), "--odometer: expected one of pioneer, ideal, poor"),
        (("--worlds", "plans"), "--worlds: expected --plans, the folder of the floor plans"),
        (("--agent", "orcale"), "did you mean oracle"),
        (("--agent", "oracle", "--task", "explore"), "expected an agent for a task that has such"),
        (("--worlds", "scene", "--task", "explore"), "expected an agent for a task that has such"),
        (("--protocol", "2"), "protocol: expected a known version: 1, found 2"),
        (
            ("--task", "homing", "--agent", "oracle", "--agent", "gap-explorer"),
            "--agent: expected agents that each have a row in these tasks and worlds, found gap-ex",
        ),
        (("--episodes", "101", *EXPLORE), "--episodes: expected 100 at most, the protocol's, fou"),
        (("--episodes", "0"), "expected a folder with results, found none"),
        (("--rows", "rows.csv"), "--rows: expected a name that ends in .jsonl.gz, found rows.csv"),
        (("--rows", "nowhere/rows.jsonl.gz"), "nowhere"),
        (("--page", "page.txt"), "--page: expected a name that ends in .md"),
        (("--page", "nowhere/page.md"), "nowhere"),
    ],
)
def test_bad_options_are_refused_before_anything_is_written(
    tmp_path: Path, call: Callable[..., Result], words: tuple[str, ...], said: str
) -> None:
    result = call("results", "--out", tmp_path / "results", "--episodes", 1, *words)
    expect_error(result, said)
    assert not list(tmp_path.iterdir())


def test_a_repeated_option_is_as_one(tmp_path: Path, call: Callable[..., Result]) -> None:
    out, file = tmp_path / "results", tmp_path / "mine.albot"
    file.write_bytes(shipped_agents()["exploring"].read_bytes())
    twice = ("--task", "Albot/Explore-v0", *EXPLORE, *EXPLORE, "--agent", "random")
    files = ("--agent", file, "--agent", tmp_path / "." / "nowhere" / ".." / "mine.albot")
    (tmp_path / "nowhere").mkdir()
    found = figures(call("results", "--out", out, *twice, *files, "--episodes", 1, "--json"))
    assert [row["episodes"] for row in found["rows"]] == [1, 1]
    assert sorted(len(each.episodes) for each in ResultsFolder(out).read()) == [1, 1]


def test_the_page_alone_needs_results_but_no_plans(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    out = tmp_path / "results"
    out.mkdir()
    expect_error(call("results", "--out", out, "--episodes", 0), "a folder with results")
    assert not list(out.iterdir())
    call("results", "--out", out, *RANDOM, "--episodes", 1)
    result = call("results", "--out", out, "--episodes", 0, "--worlds", "plans")
    assert result.exception is None
    assert "complete" not in result.stdout


@pytest.mark.parametrize("name", ["costs.json", "times.json", "agents/mine.json"])
def test_a_damaged_file_is_found_before_the_work(
    tmp_path: Path, call: Callable[..., Result], name: str
) -> None:
    out = tmp_path / "results"
    ResultsFolder(out).begin()
    (out / name).parent.mkdir(exist_ok=True)
    (out / name).write_text("{")
    expect_error(call("results", "--out", out, *RANDOM, "--episodes", 1), name)
    assert not list(out.rglob("*.jsonl"))


def test_floor_plans_must_be_those_of_the_protocol(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    plans = tmp_path / "plans"
    plans.mkdir()
    words = ("--plans", plans, "--worlds", "plans", "--agent", "random", "--task", "explore")
    with pytest.raises(InputError, match="file not found"):
        raise call("results", "--out", tmp_path / "results", *words).exception  # type: ignore[misc]
    assert [path.name for path in tmp_path.iterdir()] == ["plans"]


def test_other_folders_and_damaged_ones_are_left_as_they_are(
    tmp_path: Path, call: Callable[..., Result]
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    expect_error(call("results", "--out", tmp_path, *RANDOM), "a new or an empty folder")
    out = tmp_path / "results"
    call("results", "--out", out, *RANDOM, "--episodes", 1)
    (file,) = out.rglob("*.jsonl")
    file.write_text(file.read_text()[:-9])
    before = (out / "results.md").stat().st_mtime_ns
    expect_error(call("results", "--out", out, *RANDOM, "--episodes", 2), "line 2", "torn file")
    (out / "benchmark.json").write_text('{"protocol": 3, "version": "0.1.0"}')
    expect_error(call("results", "--out", out, *RANDOM), "a known version: 1, found 3")
    assert (out / "results.md").stat().st_mtime_ns == before


@pytest.mark.skipif(sys.platform == "win32", reason="a fork of POSIX")
def test_a_killed_run_goes_on(tmp_path: Path, call: Callable[..., Result]) -> None:
    out = tmp_path / "results"
    command = ("results", "--out", out, *RANDOM, "--json", "--episodes")
    call(*command, 1)  # All is loaded now.
    child = os.fork()
    if not child:
        call(*command, 100)
        os._exit(0)
    deadline = time.monotonic() + 100
    while _kept(out) < 4 and time.monotonic() < deadline:
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    done = _kept(out)
    assert 4 <= done < 100
    before = (out / FILE).read_bytes()
    assert figures(call(*command, done + 1))["missing"] == 0
    assert _kept(out) == done + 1
    assert (out / FILE).read_bytes().startswith(before)


FILE = Path("cells", "explore-v0", "mazes", "pioneer", "random@none.jsonl")


def _kept(out: Path) -> int:
    """The number of episodes in the cell of `RANDOM`, whose first line is its header."""
    return (out / FILE).read_bytes().count(b"\n") - 1
