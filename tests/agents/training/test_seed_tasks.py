"""Seeds that are trained as tasks of a Ray cluster, each as it is alone."""

from __future__ import annotations

import os
import signal
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_agents.engine.engine import OnStep
from albot_agents.engine.ray_cluster import RayEngine
from albot_agents.trained.agent_file import read_agent
from albot_agents.training import seed_tasks
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_tasks import train_on_cluster
from albot_core.errors import InputError
from tests.agents.training.conftest import Trained
from tests.agents.training.test_seed_processes import Notes
from tests.agents.training.tiny import begun

pytestmark = pytest.mark.skipif(
    find_spec("ray") is None, reason="Ray is not installed: pip install '.[cluster]'"
)


def fail_or_end(queue: Any, task: Any, on_step: OnStep, /) -> InputError | None:
    """Ends as its seed says."""
    seed, _ = task
    queue.put_nowait((seed, (seed, "here")))
    if seed == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if seed == 3:
        raise KeyError("lost")
    return InputError("disk", "room") if seed == 1 else None


def test_a_seed_trains_in_a_task_as_it_does_alone_and_no_failure_stops_another(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "whole").mkdir()
    folder, plan = begun(tmp_path / "whole")
    notes = Notes()
    with RayEngine(limit=2) as engine:
        assert train_on_cluster({0: (folder, plan)}, engine, notes) == ({}, False)
        monkeypatch.setattr(seed_tasks, "_train", fail_or_end)
        runs = {
            seed: (RunFolder(tmp_path / f"{seed}"), TrainingPlan(seed=seed)) for seed in range(4)
        }
        failed = Notes()
        errors, stopped = train_on_cluster(runs, engine, failed)
    one, other = read_agent(trained[0].last), read_agent(folder.last)
    for name, array in one.weights.items():
        np.testing.assert_array_equal(array, other.weights[name])
    assert folder.is_finished(plan)
    assert notes.told[0] == "begin 0"
    assert notes.told[-1].startswith("0: 64 ")
    assert (set(errors), stopped) == ({1, 2, 3}, False)
    assert str(errors[1]) == "disk: expected room"
    assert "the process died: it crashed or was killed, 4 times" in str(errors[2])
    assert "KeyError: 'lost'" in str(errors[3])
    assert {"0: 0 here", "seed 1: disk: expected room"} <= set(failed.told)
