"""What a resumed run takes up: its stage, its time, its coefficients; and what it draws anew."""

from __future__ import annotations

import itertools
import shutil
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from albot_agents.trained.agent_file import read_agent
from albot_agents.training import curriculum
from albot_agents.training.checkpoint import checkpoints
from albot_agents.training.curriculum import Curriculum
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from tests.agents.training.conftest import Trained
from tests.agents.training.tiny import begun


def _copy(folder: RunFolder, to: Path) -> RunFolder:
    return RunFolder(Path(shutil.copytree(folder.path, to)))


def test_each_start_draws_episodes_of_its_own(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a training that is stopped often learns the same few episodes again and again."""
    given: list[Any] = []
    last: list[Any] = []
    seed = Curriculum.seed
    monkeypatch.setattr(
        Curriculum, "seed", lambda its, number=None: (given.append(number), seed(its, number))[1]
    )
    for name, older in (("new", False), ("older", True), ("newest", False), ("again", False)):
        if name == "new":
            folder, plan = begun(tmp_path)
        else:
            folder = _copy(trained[0], tmp_path / name)
            plan = folder.resume(None)
        if older:
            checkpoints(folder.checkpoints)[-1].unlink()
        given.clear()
        TrainingRun(folder, plan).close()
        last.append(given[-1])
    assert last[0] == plan.seed
    assert len(set(last)) == 3
    assert last[2] == last[3]


def test_a_stage_goes_on_where_it_was(tmp_path: Path) -> None:
    """The second of three stages began after 32 samples, and takes 48."""
    stages = [
        {"for_steps": 32},
        {"env": {"max_episode_steps": 2}, "for_steps": 48},
        {"env": {"max_episode_steps": 3}},
    ]
    folder, plan = begun(tmp_path, curriculum=stages, evaluation=None)
    assert TrainingRun(folder, plan).run()["stage"] == 1
    done = len(folder.monitor.read_text().splitlines())
    for samples, stage in ((64, 1), (80, 1), (96, 2)):
        again = _copy(folder, tmp_path / str(samples))
        run = TrainingRun(again, again.resume(None, n_timesteps=samples))
        assert run.run()["stage"] == stage
        lines = again.monitor.read_text().splitlines()[done:]
        lengths = [int(line.split(",")[1]) for line in lines]
        assert max(lengths, default=0) == {64: 0, 80: 2, 96: 3}[samples]


def test_time_and_episodes_are_those_since_the_beginning(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock goes on by a second whenever it is looked at."""
    ticks = itertools.count(1000.0)
    clock = SimpleNamespace(monotonic=lambda: next(ticks), perf_counter=time.perf_counter)
    monkeypatch.setattr(curriculum, "time", clock)
    folder = _copy(trained[0], tmp_path / "again")
    before = read_agent(folder.last).training
    result = TrainingRun(folder, folder.resume(None, n_timesteps=80)).run()
    after = read_agent(folder.last).training
    assert result["seconds"] >= 1.0
    # Whole ticks since the time that was told before.
    assert result["seconds"] == pytest.approx(round(result["seconds"]), abs=1e-6)
    assert before.seconds + 1.0 <= after.seconds <= before.seconds + result["seconds"] + 0.1
    assert after.episodes == result["episodes"] > before.episodes
    assert result["samples_per_second"] == pytest.approx(16 / result["seconds"])


def test_the_entropy_counts_less_and_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, plan = begun(tmp_path, ent_coef="lin_0.4", evaluation=None)
    coefficients: list[float] = []

    def train(run: TrainingRun) -> None:
        update = run.learner.train
        monkeypatch.setattr(
            run.learner,
            "train",
            lambda: (coefficients.append(run.learner.ent_coef), update())[1],
        )
        run.run()

    train(TrainingRun(folder, plan))
    assert coefficients == pytest.approx([0.4, 0.3, 0.2, 0.1])
    train(TrainingRun(folder, folder.resume(None, n_timesteps=80)))
    assert coefficients[4:] == pytest.approx([0.4 * 16 / 80])
