"""`albot config TASK` and `albot mappers NAME`: what they print is given back as it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from albot_agents.task import config_kind, task_names
from albot_cli.config import read_task_config
from albot_cli.mappers import read_mapper_config
from albot_core.config_document import parameters
from albot_core.mappers.registry import MAPPERS, mapper_config
from tests.cli.conftest import expect_error, figures

PROJECTS = [name for name, spec in MAPPERS.items() if spec.factory.startswith("albot_core.")]
"""Mappers of the project, without those that other tests register."""


def _printed(call: Callable[..., Result], path: Path, *words: str) -> Path:
    """What a command prints, in a file."""
    result = call(*words)
    assert result.exception is None, result.exception
    path.write_text(result.stdout, encoding="utf-8")
    return path


@pytest.mark.parametrize("task", task_names())
def test_a_tasks_configuration_is_printed_and_read_back(
    call: Callable[..., Result], tmp_path: Path, task: str
) -> None:
    file = _printed(call, tmp_path / "task.yml", "config", task)
    assert read_task_config(task, file) == config_kind(task)()
    assert all(parameter.meaning for parameter in parameters(config_kind(task)()))


@pytest.mark.parametrize("mapper", PROJECTS)
def test_a_mappers_parameters_are_printed_and_read_back(
    call: Callable[..., Result], tmp_path: Path, mapper: str
) -> None:
    spec = MAPPERS[mapper]
    file = _printed(call, tmp_path / "mapper.yml", "mappers", mapper)
    assert read_mapper_config(spec, file) == mapper_config(spec)
    assert all(parameter.meaning for parameter in parameters(mapper_config(spec)))


def test_each_parameter_has_default_unit_range_and_meaning(call: Callable[..., Result]) -> None:
    lines = call("mappers", "albot1").stdout.splitlines()
    assert lines[0].startswith("# The parameters of albot1: Albot1's perceptual map")
    at = lines.index("  tolerance: 0.4  # a positive number")
    assert lines[at - 1] == "  # A correction of the map smaller than this (m) is not applied."
    found = figures(call("mappers", "albot1-thesis", "--json"))
    rows = {row["name"]: row for row in found["parameters"]}
    assert rows["places.tolerance"] == {
        "name": "places.tolerance",
        "default": 0.4,
        "range": "a positive number",
        "meaning": "A correction of the map smaller than this (m) is not applied.",
    }
    assert rows["places.match.max_shift"]["default"] == ".inf"  # JSON has no infinity.
    task = figures(call("config", "homing", "--json"))
    assert task["task"] == "Albot/Homing-v0"
    assert {row["name"]: row["default"] for row in task["parameters"]}["radius"] == 1.0


def test_unknown_names_are_told(call: Callable[..., Result]) -> None:
    expect_error(call("config", "homin"), "did you mean homing?")
    expect_error(call("mappers", "albot2"), "did you mean albot")


WRONG = {
    "radius: 1.0": ("radius: -1", "radius", "expected a positive number, found -1"),
    "  longest: 100.0": ("  longst: 9", "outing.longst", "did you mean longest?"),
}


@pytest.mark.parametrize("command", [("play",), ("evaluate", "--agent", "random")])
@pytest.mark.parametrize(("was", "told"), WRONG.items())
def test_a_wrong_task_file_is_one_error(
    call: Callable[..., Result], tmp_path: Path, command: Any, was: str, told: tuple[str, str, str]
) -> None:
    file = _printed(call, tmp_path / "task.yml", "config", "homing")
    lines = file.read_text().splitlines()
    number = next(k for k, line in enumerate(lines) if line.startswith(was))
    file.write_text("\n".join([*lines[:number], told[0], *lines[number + 1 :]]))
    words = (command[0], "homing", *command[1:], "--config", file)
    expect_error(call(*words), f"{file}, line {number + 1}, {told[1]}: ", told[2])


def test_a_wrong_mapper_file_is_one_error(
    call: Callable[..., Result], tmp_path: Path, corridor: Any
) -> None:
    file = _printed(call, tmp_path / "mapper.yml", "mappers", "odometry")
    file.write_text(file.read_text().replace("capacity: 50000", "capacity: 0.5"))
    words = ("map", corridor[0], "--mapper", "odometry", "--mapper-config", file)
    expect_error(call(*words), str(file), "capacity: expected a whole number, found 0.5")


def test_a_tasks_file_reaches_the_environment(
    call: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: None
) -> None:
    """Home is wherever the robot is, so the first declaration succeeds."""
    monkeypatch.chdir(tmp_path)
    file = _printed(call, tmp_path / "task.yml", "config", "homing")
    file.write_text(file.read_text().replace("radius: 1.0", "radius: 1000"))
    same = ("--outward", "1..2", "--config", file, "--json")
    words = ("play", "homing", "--agent", "path-integration", "--world", "square-loop", *same)
    found = figures(call(*words, "--steps", "300"))
    assert found["success"]
    words = ("evaluate", "homing", "--agent", "path-integration", "--worlds", "square-loop", *same)
    out = tmp_path / "out"
    found = figures(call(*words, "--seeds", "3", "--steps", "300", "--jobs", "1", "--out", out))
    assert (found["config"], found["success_rate"]) == (str(file), 1.0)
    assert f"--config {file}" in (out / "episodes.csv").read_text()
    assert json.loads((out / "evaluation.json").read_text())["config"] == str(file)
    expect_error(call("play", tmp_path / "episode.mcap", "--config", file), "--config")
