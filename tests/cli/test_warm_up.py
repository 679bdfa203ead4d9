"""Compiling before the first episode, by `albot warm-up`."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from albot_agents.registry import agent_names
from albot_agents.task import is_probe, short_name, task_names, untwinned
from albot_cli import warm_up
from albot_cli.group import albot
from albot_core.kernels.compiled import kernel
from albot_core.kernels.linking import Kernel
from albot_core.mappers.registry import installed_mappers
from albot_env.sim.sensing import sense


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Marks go to a folder of the test's own, which holds one index of compiled code."""
    (tmp_path / "kept.nbi").touch()
    monkeypatch.setattr(warm_up, "mark_path", lambda: tmp_path / "warm-up.json")
    monkeypatch.setattr(warm_up, "_indices", lambda: {str(p) for p in tmp_path.glob("*.nbi")})
    return tmp_path


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
        found: dict[str, float] = json.loads(done.stdout)
        return found

    assert figures()["compiled"] == 1
    warm_up.mark_path().unlink()
    assert figures()["compiled"] == 0
    assert silenced == [True, True]
    assert not logger.disabled
    done = CliRunner().invoke(albot, ["warm-up"], catch_exceptions=False)
    assert done.stdout.startswith("0 functions compiled in 0 s")


def test_a_second_call_runs_nothing_as_long_as_all_is_as_the_first_left_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    parts = {"one": lambda: done.append("one")}
    monkeypatch.setattr(warm_up, "_parts", lambda: iter(parts.items()))

    def run() -> int:
        before = len(done)
        CliRunner().invoke(albot, ["warm-up"], catch_exceptions=False)
        return len(done) - before

    assert [run(), run()] == [1, 0]
    (folder / "kept.nbi").unlink()  # Compiled code is gone.
    (folder / "other.nbi").touch()
    assert [run(), run()] == [1, 0]
    sources = folder / "package"
    sources.mkdir()
    (sources / "kernels.py").write_text("ONE = 1\n", encoding="utf-8")
    monkeypatch.setattr(warm_up, "_packages", lambda: [sources])
    assert [run(), run()] == [1, 0]
    (sources / "kernels.py").write_text("ONE = 2\n", encoding="utf-8")
    assert [run(), run()] == [1, 0]
    parts["two"] = lambda: done.append("two")
    assert [run(), run()] == [2, 0]
    warm_up.mark_path().write_text("{}", encoding="utf-8")
    assert [run(), run()] == [2, 0]


def test_a_call_that_is_broken_off_leaves_no_mark(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(warm_up, "_parts", lambda: iter([("one", int), ("two", fail)]))
    CliRunner().invoke(albot, ["warm-up"])
    assert not warm_up.mark_path().exists()


def test_warm_up_says_how_far_it_has_come(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[tuple[int, str]] = []

    class Telling:
        def __init__(self, *_: object, **__: object) -> None: ...

        def __enter__(self) -> Any:
            return lambda done, note="", share=None: found.append((done, note))

        def __exit__(self, *_: object) -> None: ...

    monkeypatch.setattr(warm_up, "progress", Telling)
    monkeypatch.setattr(warm_up, "_parts", lambda: iter([("one", int), ("two", int)]))
    CliRunner().invoke(albot, ["warm-up"], catch_exceptions=False)
    assert found == [(0, "one"), (1, "two"), (2, "")]


def test_the_time_left_goes_by_what_is_compiled_and_else_by_the_parts() -> None:
    """Most code is compiled in the first parts: their number alone would tell of half an hour."""
    assert warm_up._share(0.0, 0.0) == 0.0
    assert warm_up._share(0.5, 0.0) == 0.5  # All was compiled before.
    assert warm_up._share(0.1, 0.5) == pytest.approx(0.42)
    assert warm_up._share(1.0, 0.5) == warm_up._share(0.5, 2.0) == 1.0
    assert warm_up._kernel_count() > 500


def test_a_mark_holds_where_the_compiled_code_was_copied_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()  # The folder's own names.
    folders = [tmp_path / name / "albot_core" for name in ("here", "there")]
    found = []
    for folder in folders:
        (folder / "a" / "__pycache__").mkdir(parents=True)
        (folder / "a" / "__pycache__" / "b.nbi").touch()
        monkeypatch.setattr(warm_up, "_packages", lambda folder=folder: [folder])
        found.append(warm_up._indices())
    assert found[0] == found[1] == {"albot_core/a/__pycache__/b.nbi"}


def test_warm_up_runs_whatever_is_registered() -> None:
    names = [name for name, _ in warm_up._parts()]
    assert len(set(names)) == len(names)
    for mapper in (*installed_mappers(), "none"):
        assert f"{mapper} in a batch" in names
    for task in (name for name in task_names() if not is_probe(name)):
        assert f"a batch for {short_name(task)}" in names
        if untwinned(task) != task:
            continue  # Its agents run the same code.
        assert {f"{agent} at {short_name(task)}" for agent in agent_names(task)} <= set(names)


def test_a_part_of_warm_up_runs() -> None:
    """One of each kind, with code that other tests have compiled."""
    warm_up._run_batch()
    warm_up._run_agent("random", "Albot/Explore-v0")
    assert sense.compiled.overloads
