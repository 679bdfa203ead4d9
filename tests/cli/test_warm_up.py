"""Compiling before the first episode: once, the mapper beside all else, and nothing left behind."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

import albot_cli.play as module


class FakeProcess:
    """A compiling process that is never started."""

    begun: list[list[str]]

    def __init__(self, command: list[str], **_: Any) -> None:
        self.begun.append(command)
        self.ended: list[str] = []
        self.last.append(self)

    last: list[FakeProcess]

    def __enter__(self) -> FakeProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.append("left")

    def wait(self) -> None:
        self.ended.append("waited")

    def kill(self) -> None:
        self.ended.append("killed")


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> list[FakeProcess]:
    FakeProcess.begun, FakeProcess.last = [], []
    monkeypatch.setattr(subprocess, "Popen", FakeProcess)
    return FakeProcess.last


def test_what_is_compiled_is_not_compiled_again(
    processes: list[FakeProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_is_compiled", lambda _: True)
    module.warm_up("albot1")
    assert not processes


def test_the_mapper_is_compiled_in_a_process_of_its_own(
    processes: list[FakeProcess],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(module, "_is_compiled", lambda _: False)
    module.warm_up("albot1")
    assert [command[1:] for command in FakeProcess.begun] == [
        ["-m", "albot_core.mappers.precompile", "albot1"]
    ]
    assert processes[0].ended[0] == "waited"
    said = capsys.readouterr()
    assert said.out == ""
    assert "compiling" in said.err


def test_an_interruption_takes_the_process_with_it(
    processes: list[FakeProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "_is_compiled", lambda _: False)
    monkeypatch.setattr("gymnasium.make", interrupted)
    with pytest.raises(KeyboardInterrupt):
        module.warm_up("albot1")
    assert processes[0].ended == ["killed", "left"]


def test_a_kernel_that_has_run_is_compiled() -> None:
    from albot_env.tasks.core.observation_parts import make_log_scale, scaled

    scaled(1.0, make_log_scale(1.0, 2.0))
    assert module._is_compiled(scaled)
