"""Compiling before the first episode, by `albot play` and `albot warm-up`."""

from __future__ import annotations

import json
import logging
import subprocess
from typing import Any

import pytest
from click.testing import CliRunner

import albot_cli.play as module
from albot_agents.registry import agent_names
from albot_agents.task import short_name, task_names
from albot_cli import warm_up
from albot_cli.group import albot
from albot_core.kernels.compiled import kernel
from albot_core.kernels.linking import Kernel
from albot_core.mappers.registry import installed_mappers
from albot_env.sim.sensing import sense


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
    processes: list[FakeProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_is_compiled", lambda _: False)
    module.warm_up("albot1")
    assert [command[1:] for command in FakeProcess.begun] == [
        ["-m", "albot_core.mappers.precompile", "albot1"]
    ]
    assert processes[0].ended[0] == "waited"


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


@kernel()
def _half(x: float) -> float:
    return 0.5 * x


def test_warm_up_compiles_what_is_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    fresh = Kernel(lambda x: 2.0 * _half(x), targetoptions={"nopython": True})  # Never kept.
    logger = logging.getLogger("albot_core.kernels")
    silenced: list[bool] = []
    parts = [("fresh", lambda: silenced.append(logger.disabled)), ("again", lambda: fresh(1.0))]
    monkeypatch.setattr(warm_up, "_parts", lambda: iter(parts))

    def figures() -> dict[str, float]:
        done = CliRunner().invoke(albot, ["warm-up", "--json"], catch_exceptions=False)
        told: dict[str, float] = json.loads(done.stdout)
        return told

    assert figures()["compiled"] == 1
    assert figures()["compiled"] == 0
    assert silenced == [True, True]
    assert not logger.disabled
    done = CliRunner().invoke(albot, ["warm-up"], catch_exceptions=False)
    assert done.stdout.startswith("0 functions compiled in 0 s")


def test_warm_up_says_how_far_it_has_come(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[int, str]] = []

    class Telling:
        def __init__(self, *_: object, **__: object) -> None: ...

        def __enter__(self) -> Any:
            return lambda done, note="": told.append((done, note))

        def __exit__(self, *_: object) -> None: ...

    monkeypatch.setattr(warm_up, "progress", Telling)
    monkeypatch.setattr(warm_up, "_parts", lambda: iter([("one", int), ("two", int)]))
    CliRunner().invoke(albot, ["warm-up"], catch_exceptions=False)
    assert told == [(0, "one"), (1, "two"), (2, "")]


def test_warm_up_runs_whatever_is_registered() -> None:
    names = [name for name, _ in warm_up._parts()]
    assert len(set(names)) == len(names)
    for mapper in (*installed_mappers(), "none"):
        assert f"{mapper} in a batch" in names
    for task in task_names():
        assert f"a batch for {short_name(task)}" in names
        assert {f"{agent} at {short_name(task)}" for agent in agent_names(task)} <= set(names)


def test_a_part_of_warm_up_runs() -> None:
    """One of each kind, with code that other tests have compiled."""
    warm_up._run_batch()
    warm_up._run_agent("random", "Albot/Explore-v0")
    assert sense.compiled.overloads
