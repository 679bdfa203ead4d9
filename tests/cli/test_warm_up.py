"""Compiling before the first episode, by `albot warm-up`."""

from __future__ import annotations

import json
import logging
from typing import Any

import pytest
from click.testing import CliRunner

from albot_agents.registry import agent_names
from albot_agents.task import short_name, task_names
from albot_cli import warm_up
from albot_cli.group import albot
from albot_core.kernels.compiled import kernel
from albot_core.kernels.linking import Kernel
from albot_core.mappers.registry import installed_mappers
from albot_env.sim.sensing import sense


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
