"""A sweep on a real Ray cluster: its trials are trainings like any, and a kill loses nothing."""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import signal
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import albot_env
from albot_agents.engine.ray_cluster import RayEngine
from albot_agents.trained.agent_file import read_agent
from albot_agents.training import run_files
from albot_agents.training.plan_file import read_plan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_agents.training.sweep import _Notes, _Shared, _train, run_sweep
from albot_agents.training.sweep_folder import SweepFolder
from albot_core.errors import InputError
from tests.agents.training.conftest import Trained
from tests.agents.training.tiny import TINY, plan_file

pytestmark = pytest.mark.skipif(
    find_spec("ray") is None, reason="Ray is not installed: pip install '.[cluster]'"
)


class Notes:
    """Keeps what is told."""

    def __init__(self, interrupt: bool = False) -> None:
        self.told: list[tuple[int, str]] = []
        self.warned: list[str] = []
        self._interrupts = interrupt

    def progress(self, samples: int, note: str) -> None:
        self.told.append((samples, note))
        if self._interrupts:
            self._interrupts = False
            os.kill(os.getpid(), signal.SIGINT)

    def warn(self, text: str) -> None:
        self.warned.append(text)


@pytest.fixture(scope="module")
def engine() -> Iterator[RayEngine]:
    with RayEngine(limit=2) as made:
        yield made


@pytest.fixture(autouse=True)
def hears_ctrl_c() -> Iterator[None]:
    """Where tests run in the background of a shell, Ctrl-C is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _begun(folder: Path, **sweep: Any) -> tuple[SweepFolder, Any, Any]:
    search = {"parameters": {"gamma": {"choices": [0.9, 0.99]}}, "trials": None}
    path = plan_file(folder / "plan.yml", TINY, sweep=search | {"metric": "return"} | sweep)
    plan = read_plan(path)
    found = SweepFolder(folder / "out")
    return found, plan, found.begin(plan, "albot train plan.yml --engine ray", path)


def test_the_best_trials_are_trainings_like_any_and_the_others_end_early(
    engine: RayEngine, tmp_path: Path
) -> None:
    # Hardly anything is learnt, so that a trial is as good as its initial action.
    search = {
        "policy.initial_action": {"choices": [[0, 0, -1], [1, 0.3, -1], [1, 0.2, -1]]},
        "learning_rate": {"choices": [1e-6]},
    }
    folder, plan, runs = _begun(tmp_path, parameters=search, reduction=3)
    notes = Notes()
    assert run_sweep(folder, plan, runs, engine, notes) == ({}, False)
    assert notes.warned == []
    assert not folder.tune.exists()
    assert notes.told[-1][0] == 3 * plan.n_timesteps
    best = folder.best("return")
    assert best is not None
    assert notes.told[-1][1] == f"best return {best[1]:.2f}, trial {best[0]}"
    finished = {number for number, (run, its) in runs.items() if run.is_finished(its)}
    assert set(folder.ended) == set(runs) - finished
    assert best[0] in finished

    run, its = runs[best[0]]
    alone = RunFolder(tmp_path / "alone")
    alone.begin(read_plan(run.plan, saved=True), "")
    TrainingRun(alone, its).run()
    names = {path.name for path in run.path.iterdir()}
    assert names == {path.name for path in alone.path.iterdir()}
    one, other = read_agent(run.last), read_agent(alone.last)
    assert one.training.curve == other.training.curve
    for name, array in one.weights.items():
        np.testing.assert_array_equal(array, other.weights[name])


def test_after_ctrl_c_a_sweep_goes_on(engine: RayEngine, tmp_path: Path) -> None:
    folder, plan, runs = _begun(tmp_path, scheduler="none")
    assert run_sweep(folder, plan, runs, engine, Notes(interrupt=True)) == ({}, True)
    assert not folder.tune.exists()
    before = {number: folder.curve(number) for number in runs}
    assert any(before.values())
    assert not all(run.is_finished(its) for run, its in runs.values())

    again = SweepFolder(tmp_path / "out")
    plan, runs = again.resume(None)
    assert run_sweep(again, plan, runs, engine, Notes()) == ({}, False)
    for number, (run, its) in runs.items():
        assert run.is_finished(its)
        for name, known in before[number].items():
            assert again.curve(number)[name][: len(known)] == known


def test_a_trial_that_was_ended_tells_its_evaluations_and_one_that_cannot_go_on_its_error(
    engine: RayEngine, trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ray import tune

    told: list[dict[str, Any]] = []
    monkeypatch.setattr(tune, "report", told.append)
    run = RunFolder(Path(shutil.copytree(trained[0].path, tmp_path / "trial-0")))
    runs = {0: (run, replace(trained[1], n_timesteps=1_000_000))}
    shared = _Shared(str(tmp_path), albot_env.__version__, "return", frozenset({0}))
    before = run.last.read_bytes()
    _train(shared, runs, {"trial": 0})
    assert [figures["samples"] for figures in told] == [32, 64]
    assert run.last.read_bytes() == before
    _train(replace(shared, version="0"), runs, {"trial": 0})
    assert "expected albot-env 0 on all nodes" in told[-1]["error"]
    with run.locked():
        monkeypatch.setattr(run_files, "_PATIENCE", 0.0)
        _train(replace(shared, over=frozenset()), runs, {"trial": 0})
    assert "expected a folder that no other process writes into" in told[-1]["error"]


def test_a_trial_that_cannot_go_on_is_told_once_and_the_others_go_on(
    engine: RayEngine, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder, plan, runs = _begun(tmp_path, scheduler="none")
    (runs[0][0].path / "tensorboard").write_text("no folder")
    notes = Notes()
    errors, stopped = run_sweep(folder, plan, runs, engine, notes)
    assert (list(errors), stopped) == ([0], False)
    assert notes.warned == [f"trial 0: {errors[0]}"]
    assert "FileExistsError" in errors[0]
    assert folder.ended == ()
    assert runs[1][0].is_finished(runs[1][1])
    assert "Traceback" not in "".join(capfd.readouterr())


def test_what_ray_tune_tells_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, plan, _ = _begun(tmp_path)
    notes = Notes()
    told = _Notes(folder, plan, notes)
    told.add(0, {"samples": plan.n_timesteps, "return": 2.0})
    told.end(0)
    told.add(1, {"samples": 32, "return": 1.0})
    told.end(1)
    assert list(folder.ended) == [1]
    assert notes.told[-1] == (2 * plan.n_timesteps, "best return 2.00, trial 0")
    assert told.fault is None

    def full(self: SweepFolder, trial: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(self.trials))

    monkeypatch.setattr(SweepFolder, "end", full)
    told.add(1, {"samples": 32, "return": 1.0})
    told.end(1)
    assert "No space left on device" in str(told.fault)
    told.add(0, {"samples": 0, "return": -math.inf, "error": "it is gone"})
    told.end(0)
    assert (told.errors, notes.warned) == ({0: "it is gone"}, ["trial 0: it is gone"])
    told.fail(1, "its node died")
    told.end(1)  # It was run again.
    assert list(told.errors) == [0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "sweep.json, line 1: expected valid JSON"),
        ({"trials": []}, "expected the values of one trial or more, found none"),
        ({"ended": [2]}, r"sweep.json, ended\[0\]: expected a trial from 0 to 1, found 2"),
        ({"trials": [3]}, r"trials\[0\]: expected a mapping"),
    ],
)
def test_damaged_folders_are_refused(content: Any, message: str, tmp_path: Path) -> None:
    folder, _, _ = _begun(tmp_path)
    if isinstance(content, dict):
        content = json.dumps(json.loads(folder.trials.read_text()) | content)
    folder.trials.write_text(content)
    with pytest.raises(InputError, match=message):
        SweepFolder(folder.path).resume(None)


def test_folders_with_runs_are_not_begun_anew_and_trials_that_never_began_are_made(
    tmp_path: Path,
) -> None:
    folder, plan, runs = _begun(tmp_path)
    with pytest.raises(InputError, match=r"without runs \(or --resume .*out\), found sweep.json"):
        SweepFolder(folder.path).begin(plan, "", tmp_path / "plan.yml")
    shutil.rmtree(runs[1][0].path)
    _, again = SweepFolder(folder.path).resume(None)
    assert again[1][1] == runs[1][1]
    assert again[1][0].command == "albot train plan.yml --engine ray"
