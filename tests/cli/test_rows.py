"""Runs that are stopped or killed and go on: nothing is done twice, and nothing is missing."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from albot_agents.engine import choice
from albot_agents.engine.rows import TAIL, parts
from albot_core.files import write_text
from albot_maps import load_world
from albot_maps.formats.world_file import world_text
from tests.cli.conftest import expect_error, figures
from tests.inline_engine import InlineEngine, stopping_after
from tests.processes import ALBOT, running, wait_until

Call = Callable[..., Result]
EVALUATE = ("evaluate", "explore", "--agent", "random", "--against", "gap-explorer",
            "--mapper", "none", "--worlds", "square-loop", "--seeds", "2..5", "--steps", "8",
            "--json")  # fmt: skip


def comparable(found: dict[str, Any]) -> dict[str, Any]:
    """What two runs of the same must have in common."""
    return {
        name: value for name, value in found.items() if not name.startswith(("second", "steps_"))
    }


@pytest.mark.parametrize("batch", ["1", "2"])
def test_an_evaluation_goes_on_where_it_was_stopped(
    tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch, batch: str
) -> None:
    """In batches or not: the figures are those of a run that was not stopped."""
    words = (*EVALUATE, "--batch", batch, "--out", tmp_path / "out")
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: InlineEngine(backwards=True))
    whole = figures(call(*words, "--rows", tmp_path / "whole"))
    shutil.rmtree(tmp_path / "out")
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: stopping_after(3))
    rows = tmp_path / "rows"
    stopped = call(*words, "--rows", rows)
    assert stopped.return_value == 130
    written = json.loads((tmp_path / "out/evaluation.json").read_text())
    assert 0 < written["episodes"] < whole["episodes"]
    run: list[Any] = []
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: InlineEngine(run.append))
    resumed = figures(call("evaluate", "--resume", rows, "--json"))
    episodes = [each for task in run for each in (task if isinstance(task, list) else [task])]
    assert len(episodes) == 8 - 3 * int(batch)
    assert comparable(resumed | {"rows": ""}) == comparable(whole | {"rows": ""})
    assert json.loads((tmp_path / "out/evaluation.json").read_text())["episodes"] == 4
    run.clear()
    call("evaluate", "--resume", rows, "--json")
    assert not run


def test_a_stopped_run_tells_how_it_goes_on(
    tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: stopping_after(2))
    stopped = call(*EVALUATE[:-1], "--rows", tmp_path / "r")
    assert f"continue with: albot evaluate --resume {tmp_path / 'r'}" in stopped.stdout


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (
            ("--resume", "{rows}", "--seeds", "1..2"),
            "--seeds: expected no such option with --resume",
        ),
        (("--resume={rows}", "homing"), "homing: expected no such argument with --resume"),
        (
            ("--resume", "{rows}", "--rows", "other"),
            "--rows: expected no such option with --resume",
        ),
        (
            ("--resume", "{rows}/nowhere"),
            "nowhere: expected the folder of rows of `albot evaluate`",
        ),
        ((*EVALUATE[1:], "--rows", "{rows}"), "expected a new or an empty folder (or --resume)"),
        ((*EVALUATE[1:], "--rows", "new", "--record", "films"), "--rows: expected no --record"),
    ],
)
def test_what_does_not_go_together(
    tmp_path: Path, call: Call, in_process: None, words: tuple[str, ...], found: str
) -> None:
    rows = tmp_path / "rows"
    call(*EVALUATE, "--rows", rows)
    before = {path.name: path.read_bytes() for path in rows.iterdir()}
    expect_error(call("evaluate", *(word.format(rows=rows) for word in words)), found)
    assert {path.name: path.read_bytes() for path in rows.iterdir()} == before


def test_rows_of_another_command_are_refused(tmp_path: Path, call: Call, in_process: None) -> None:
    call(*EVALUATE, "--rows", tmp_path / "rows")
    expect_error(call("stress", "--resume", tmp_path / "rows"), "expected rows of `albot stress`")


def test_a_changed_world_is_another_run(
    tmp_path: Path, call: Call, in_process: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = tmp_path / "world.yaml"
    write_text(world, world_text(load_world("square-loop")))
    words = [str(world) if word == "square-loop" else word for word in EVALUATE]
    call(*words, "--rows", tmp_path / "rows")
    world.write_text(world.read_text() + "\n# Another comment.\n")
    expect_error(call("evaluate", "--resume", tmp_path / "rows"), "whose files is", "run.json")


def test_a_stress_run_that_is_killed_goes_on(tmp_path: Path) -> None:
    words = ("stress", "--worlds", "square-loop", "--count", "1000", "--steps", "8", "--agent",
             "random", "--jobs", "1", "--json")  # fmt: skip
    rows = tmp_path / "rows"
    with running([*ALBOT, *words, "--rows", "rows"], tmp_path) as process:
        wait_until(lambda: (rows / TAIL).exists() and (rows / TAIL).stat().st_size > 0, 240)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=60)
    kept = len((rows / TAIL).read_text().splitlines())
    assert kept >= 1
    with running([*ALBOT, "stress", "--resume", "rows", "--json"], tmp_path) as process:
        out, errors = process.communicate(timeout=240)
    assert (process.returncode, errors) == (0, b"")
    found = json.loads(out)
    assert (found["episodes"], found["steps"], found["violations"]) == (1000, 8000, [])
    assert len(parts(rows)) == 1
