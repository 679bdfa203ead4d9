"""Processes of several seeds: one that fails leaves the others alone, and Ctrl-C stops all."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from albot_agents.trained.agent_file import read_agent
from albot_agents.training import journeys, seed_processes
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_folder import SeedRun
from albot_agents.training.seed_processes import train_seeds
from albot_core.plain_data import deep_merge
from tests.agents.training.conftest import Trained
from tests.agents.training.quick_training import fail_or_end, make_or_get, wait_for_stop
from tests.agents.training.tiny import TINY, begun


@pytest.fixture(autouse=True)
def hears_ctrl_c() -> Iterator[None]:
    """Where tests run in the background of a shell, Ctrl-C is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Notes:
    """Keeps what is told; `act` is called with it too."""

    def __init__(self, act: Callable[[str], None] = lambda text: None) -> None:
        self.told: list[str] = []
        self._act = act

    def begin(self, seed: int, samples: int) -> Callable[[int, str], None]:
        self._tell(f"begin {seed}")
        return lambda samples, note: self._tell(f"{seed}: {samples} {note}")

    def warn(self, text: str) -> None:
        self._tell(text)

    def stop(self) -> None:
        self._tell("stop")

    def _tell(self, text: str) -> None:
        self.told.append(text)
        self._act(text)


def _runs(folder: Path, *seeds: int) -> dict[int, SeedRun]:
    return {seed: (RunFolder(folder / f"{seed}"), TrainingPlan(seed=seed)) for seed in seeds}


def test_the_failure_of_one_seed_stops_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seed_processes, "_train", fail_or_end)
    notes = Notes()
    errors, stopped = train_seeds(_runs(tmp_path, 1, 2, 3, 0), 2, notes)
    assert not stopped
    assert set(errors) == {1, 2, 3}
    assert str(errors[1]) == "disk: expected room"
    assert "2: expected a process that trains to the end, found one that died: signal SIGKILL" in (
        str(errors[2])
    )
    assert isinstance(errors[3], RuntimeError)
    assert {"0: 0 here", "seed 0: look", "seed 1: disk: expected room"} <= set(notes.told)


def test_the_first_process_makes_the_journeys_of_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seed_processes, "_train", make_or_get)
    notes = Notes()
    assert train_seeds(_runs(tmp_path, 4, 5, 6), 3, notes) == ({}, False)
    assert notes.told[:2] == ["begin 4", "4: 0 nothing"]
    assert {"5: 0 journeys", "6: 0 journeys"} <= set(notes.told)


def test_journeys_are_made_once_for_all_seeds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The agents are those of runs that make their own."""
    plan = {"env": {"journeys": 16, "threads": 2}, "evaluation": None, "n_timesteps": 32}
    runs = {}
    for seed in (0, 1, 2):
        (folder := tmp_path / f"{seed}").mkdir()
        runs[seed] = begun(folder, deep_merge(TINY, plan), seed=seed)
    notes = Notes()
    assert train_seeds({seed: runs[seed] for seed in (0, 1)}, 2, notes) == ({}, False)
    assert "0: 0 16 of 16 journeys made" in notes.told
    assert not [note for note in notes.told if note.startswith("1:") and "journeys" in note]
    monkeypatch.setattr(journeys, "FEWEST_JOURNEYS", 17)  # It makes each when it needs it.
    TrainingRun(runs[2][0], replace(runs[2][1], seed=1)).run()
    one, other = (read_agent(runs[seed][0].last).weights for seed in (1, 2))
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name])


def _interrupting(*texts: str) -> Notes:
    return Notes(lambda text: signal.raise_signal(signal.SIGINT) if text in texts else None)


def test_ctrl_c_stops_those_that_run_and_starts_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seed_processes, "_train", wait_for_stop)
    notes = _interrupting("0: 0 begun")
    errors, stopped = train_seeds(_runs(tmp_path, 0, 5), 1, notes)
    assert (errors, stopped) == ({}, True)
    assert notes.told == ["begin 0", "0: 0 begun", "stop"]
    assert [path.name for path in tmp_path.iterdir()] == ["0"]


def _alarm() -> None:
    signal.setitimer(signal.ITIMER_REAL, 0.1)


def test_a_second_ctrl_c_ends_what_does_not_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seed_processes, "_train", wait_for_stop)
    # One while it waits for messages, and one while it waits for the end.
    notes = Notes(lambda text: _alarm() if text != "begin 1" else None)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        found = train_seeds(_runs(tmp_path, 1), 1, notes)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert found == ({}, True)
    assert notes.told == ["begin 1", "1: 0 begun", "stop"]
    assert not list(tmp_path.iterdir())


def test_a_seed_trains_in_its_process_as_it_does_alone(trained: Trained, tmp_path: Path) -> None:
    folder, plan = begun(tmp_path)
    notes = Notes()
    assert train_seeds({0: (folder, plan)}, 1, notes) == ({}, False)
    one, other = read_agent(trained[0].last), read_agent(folder.last)
    for name, array in one.weights.items():
        np.testing.assert_array_equal(array, other.weights[name])
    assert folder.is_finished(plan)
    assert not folder.is_finished(replace(plan, n_timesteps=65))
    assert notes.told[0] == "begin 0"
    assert notes.told[-1].startswith("0: 64 ")
