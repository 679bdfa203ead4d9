"""`albot results --mapper`: mappers are compared, and the page has their section and picture."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result

from albot_agents.benchmark.entrant import find_entrant
from albot_agents.benchmark.folder import ResultsFolder
from albot_agents.benchmark.protocol import Protocol, find_protocol
from albot_agents.engine import choice
from albot_cli.mapper_results import measure_costs
from albot_core.errors import InputError
from albot_env.tasks.homing_by_map.changes import ChangesConfig
from tests.cli.conftest import expect_error, figures
from tests.env.quick import STROLL_BY_MAP
from tests.inline_engine import InlineEngine

UNCHANGED = replace(
    STROLL_BY_MAP,
    changes=ChangesConfig(door_shut=0.0, door_opened=0.0, carried=0.0, furniture_moved=0.0),
)
HOMING = ("--task", "homing-by-map", "--odometer", "pioneer", "--episodes", 2)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes are of ten steps after a stroll, and run in this process; intervals are rough."""

    def find(version: int) -> Protocol:
        protocol = find_protocol(version)
        tasks = {task: replace(each, steps=10) for task, each in protocol.tasks.items()}
        return replace(protocol, tasks=tasks)

    monkeypatch.setattr("albot_agents.benchmark.folder.find_protocol", find)
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: InlineEngine())
    monkeypatch.setattr(
        "albot_agents.benchmark.mappers.sensors_for", lambda mapper: {"config": UNCHANGED}
    )
    monkeypatch.setattr(
        "albot_agents.benchmark.run.find_entrant",
        lambda name: replace(find_entrant(name), settings={"config": UNCHANGED}),
    )
    monkeypatch.setattr("albot_core.evaluation.logistic._RESAMPLES", 20)
    monkeypatch.setattr("albot_cli.mapper_results._STEPS", 30)


def test_mappers_are_compared_and_drawn(tmp_path: Path, call: Callable[..., Result]) -> None:
    out = tmp_path / "results"
    two = ("--mapper", "none", "--mapper", "albot1")
    found = figures(call("results", "--out", out, *two, *HOMING, "--json"))
    assert found["missing"] == 0
    cells = {each.cell.mapper: each.episodes for each in ResultsFolder(out).read()}
    maps = {mapper: min(one.info["updates"] for one in its) > 0 for mapper, its in cells.items()}
    assert maps == {"albot1": True, "none": False}
    # The table of agents has an agent with its own mapper alone.
    assert found["rows"] == []
    data = json.loads((out / "results.json").read_text())["mappers"]
    assert [row["mapper"] for row in data["rows"]] == ["none", "albot1"]
    assert {row["episodes"] for row in data["rows"]} == {2}
    assert data["costs"] == json.loads((out / "costs.json").read_text())["costs"]
    assert data["costs"]["albot1"] > 0
    assert set(data["costs"]) == {"albot1"}
    assert data["curves"]["map-homing"]["episodes"] == 4
    assert found["mappers"] == data
    page = (out / "results.md").read_text()
    assert "## Mappers" in page
    assert json.loads((out / "results.json").read_text())["sentences"] == []  # Of two episodes.
    assert "(results-mappers.png)" in page
    picture = out / "results-mappers.png"
    assert found["files"]["picture"] == str(picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    # Another mapper is one more row; what was measured stays, costs too.
    before = (out / "costs.json").read_bytes()
    call("results", "--out", out, "--mapper", "odometry", *HOMING)
    data = json.loads((out / "results.json").read_text())["mappers"]
    assert [row["mapper"] for row in data["rows"]] == ["none", "albot1", "odometry"]
    assert before[: before.index(b'"albot1"')] in (out / "costs.json").read_bytes()
    assert set(data["costs"]) == {"albot1", "odometry"}


def test_a_driver_is_a_column(tmp_path: Path, call: Callable[..., Result]) -> None:
    out = tmp_path / "results"
    drivers = ("--agent", "map-homing", "--agent", "home-vector", "--agent", "home-vector")
    two = ("--mapper", "none", "--mapper", "albot1")
    found = figures(call("results", "--out", out, *drivers, *two, *HOMING, "--json"))
    assert found["missing"] == 0
    data = json.loads((out / "results.json").read_text())["mappers"]
    assert [(row["driver"], row["mapper"]) for row in data["rows"]] == [
        (driver, mapper) for driver in ("map-homing", "home-vector")
        for mapper in ("none", "albot1")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("albot7",), "found 'albot7' (did you mean albot1?)"),
        (("albot1", "--worlds", "mazes"), "--worlds: expected offices, in which"),
        (("albot1", "--task", "homing"), "--task: expected a task in which mappers are compared"),
        (("albot1", "--odometer", "bias-3"), "--odometer: expected one of pioneer"),
        (("albot1", "--agent", "round-trip"), "expected an agent for a task in which mappers"),
        (("albot1", "--agent", "map-homing", "--agent", "round-trip"), "each have a row in these"),
        (("albot1", "--agent", "map-homing", "--agent", "nearest-frontier"), "each have a row in"),
        (("albot1", "--task", "explore", "--agent", "random"), "expected an agent for a task in"),
    ],
)
def test_what_cannot_be_compared_is_refused_before_anything_is_written(
    words: tuple[str, ...], message: str, tmp_path: Path, call: Callable[..., Result]
) -> None:
    out = tmp_path / "results"
    expect_error(call("results", "--out", out, "--mapper", *words), message)
    assert not out.exists()


def test_damaged_costs_are_refused(tmp_path: Path, call: Callable[..., Result]) -> None:
    out = tmp_path / "results"
    ResultsFolder(out).begin()
    (out / "costs.json").write_text('{"costs": {"albot1": "dear"}}')
    result = call("results", "--out", out, "--episodes", 0)
    expect_error(result, "costs.json", "albot1: expected a number")


def test_costs_are_written_by_one_process_at_a_time(tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "results")
    folder.begin()
    other = ResultsFolder(folder.path)
    with other.locked(), pytest.raises(InputError, match="no other process writes into"):
        measure_costs(folder, ["odometry"])
    assert not (folder.path / "costs.json").exists()
