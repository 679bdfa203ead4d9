"""Compiling in two processes where nothing is compiled yet."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from typing import Any

import pytest

from albot_core.mappers.registry import NO_MAPPER
from albot_env.sim import choose_sensors
from albot_env.tasks.core import precompile as module
from albot_env.tasks.core.settings import Equipment

EQUIPMENT = Equipment(
    mapper="albot1",
    sensors=choose_sensors(
        laser="lms-200", odometer="pioneer", sonar="pioneer", scenes="none", source="sensors"
    ),
)


class FakeProcess:
    """A compiling process that is never started."""

    def __init__(self, command: tuple[str, ...], **_: Any) -> None:
        self.command, self.ended = command, list[str]()

    def __enter__(self) -> FakeProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.append("left")

    def wait(self) -> None:
        self.ended.append("waited")

    def kill(self) -> None:
        self.ended.append("killed")


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[FakeProcess]:
    """The processes that are begun, on a machine where nothing is compiled yet."""
    processes: list[FakeProcess] = []

    def begin(*arguments: Any, **options: Any) -> FakeProcess:
        processes.append(FakeProcess(*arguments, **options))
        return processes[-1]

    monkeypatch.setattr(subprocess, "Popen", begin)
    monkeypatch.setattr(module, "is_compiled", lambda: False)
    monkeypatch.setattr(module, "processors", lambda: 2)
    monkeypatch.setattr(module, "parent_process", lambda: None)
    return processes


def test_the_mapper_is_compiled_in_a_process_of_its_own(begun: list[FakeProcess]) -> None:
    module.precompile(EQUIPMENT)
    (process,) = begun
    assert process.command[1:] == ("-m", "albot_core.mappers.precompile", "albot1")
    assert process.ended[0] == "waited"


@pytest.mark.parametrize("sensor", ["laser", "sonar"])
def test_robots_with_fewer_sensors_are_run(begun: list[FakeProcess], sensor: str) -> None:
    module.precompile(replace(EQUIPMENT, sensors=replace(EQUIPMENT.sensors, **{sensor: None})))
    assert begun[0].ended[0] == "waited"


@pytest.mark.parametrize(
    ("name", "found"),
    [("is_compiled", True), ("processors", 1), ("parent_process", object())],
    ids=["compiled", "one processor", "a worker"],
)
def test_no_process_is_begun_where_none_helps(
    begun: list[FakeProcess], monkeypatch: pytest.MonkeyPatch, name: str, found: Any
) -> None:
    monkeypatch.setattr(module, name, lambda: found)
    module.precompile(EQUIPMENT)
    assert not begun


def test_without_a_mapper_no_process_is_begun(begun: list[FakeProcess]) -> None:
    module.precompile(replace(EQUIPMENT, mapper=NO_MAPPER))
    assert not begun


def test_where_no_process_can_be_begun_all_is_compiled_later(
    begun: list[FakeProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise OSError

    monkeypatch.setattr(subprocess, "Popen", refused)
    module.precompile(EQUIPMENT)
    assert not begun


def test_an_interruption_takes_the_process_with_it(
    begun: list[FakeProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "_run_robots", interrupted)
    with pytest.raises(KeyboardInterrupt):
        module.precompile(EQUIPMENT)
    assert begun[0].ended == ["killed", "left"]


def test_what_has_run_is_compiled() -> None:
    module._run_robots(EQUIPMENT)
    assert module.is_compiled()


def test_robots_without_a_mapper_run_for_a_step() -> None:
    module._run_robots(replace(EQUIPMENT, mapper=NO_MAPPER, mapper_config=None, threads=1))
