"""`albot experiment` on a toy experiment that takes no time."""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from click.testing import Result

from albot_cli import progress
from albot_experiments.registry import EXPERIMENTS, FIRST_SEED, Experiment
from albot_experiments.report import REPORT_FILES, Report
from tests.cli.conftest import expect_error, figures


def _run(seeds: range, progress: Callable[[int], None]) -> Report:
    """Measure which seeds it was given."""
    for done, _ in enumerate(seeds, start=1):
        progress(done)
    measured = {"first": seeds[0], "last": seeds[-1]}
    return Report(id="toy", title="A toy", paper={"first": 7}, measured=measured, holds=True)


@pytest.fixture(autouse=True)
def toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """The toy among the experiments."""
    module = ModuleType("toy_experiment")
    module.run = _run
    monkeypatch.setitem(sys.modules, "toy_experiment", module)
    experiment = Experiment(id="toy", title="A toy", seeds=4, module="toy_experiment")
    monkeypatch.setitem(EXPERIMENTS, "toy", experiment)


def test_an_experiment_tells_how_many_seeds_are_done(
    call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(monotonic=itertools.count(0.0, 1.0).__next__)
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    found = call("experiment", "run", "toy", "--seeds", "3..5").stderr.splitlines()
    assert [line.split(", ")[0] for line in found] == [f"toy: {k} of 3 seeds" for k in (1, 2, 3)]


@pytest.mark.parametrize(
    ("words", "first", "last"),
    [((), FIRST_SEED, FIRST_SEED + 3), (("--seeds", "3..5"), 3, 5)],
)
def test_it_runs_over_its_own_seeds_or_those_asked_for(
    call: Callable[..., Result], words: tuple[str, ...], first: int, last: int
) -> None:
    found = figures(call("experiment", "run", "toy", *words, "--json"))
    assert (found["id"], found["holds"], found["files"]) == ("toy", True, [])
    assert found["measured"] == {"first": first, "last": last}
    lines = call("experiment", "run", "toy", *words).stdout.splitlines()
    assert lines[0] == "toy: A toy"
    assert ["first", str(first), "7"] in [line.split() for line in lines]
    assert "Reached." in lines


def test_its_report_is_written_and_not_over_another_one(
    call: Callable[..., Result], tmp_path: Path
) -> None:
    out = tmp_path / "toy"
    words = ("experiment", "run", "toy", "--seeds", "3..5", "--out", out)
    found = figures(call(*words, "--json"))
    assert found["files"] == [str(out / name) for name in REPORT_FILES]
    assert json.loads((out / "result.json").read_text())["measured"] == found["measured"]
    expect_error(call(*words), "result.json", "--force")
    assert call(*words, "--force").exception is None
    expect_error(call("experiment", "run", "toi"), "did you mean toy?")
