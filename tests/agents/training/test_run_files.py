"""Checkpoints and monitor files: what is wrong with one is refused, and no write is left half."""

from __future__ import annotations

import errno
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_agents.training import run_files
from albot_agents.training.checkpoint import Checkpoint, checkpoints, read_checkpoint, restore
from albot_agents.training.run_files import EpisodeLog
from albot_core.errors import InputError
from tests.agents.training.conftest import Trained


@pytest.fixture
def saved(trained: Trained) -> Checkpoint:
    return read_checkpoint(checkpoints(trained[0].checkpoints)[-1])


WEIGHT = "weight.action_net.weight"


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        (WEIGHT, None, "expected the array weight.action_net.weight, found none"),
        (WEIGHT, np.zeros((3, 9), np.float32), r"expected \[3, 8\] of torch.float32, found \[3, 9"),
        (WEIGHT, np.zeros((3, 8)), r"expected \[3, 8\] of torch.float32, found .*float64"),
        ("adam.exp_avg.log_std", None, "the array adam.exp_avg.log_std"),
        ("random.numpy", np.zeros(3, np.uint32), r"expected \[624\] of torch.uint32"),
        ("random.torch", None, "the array random.torch"),
        ("weight.more", np.zeros(3), "only this learner's arrays, found weight.more"),
    ],
)
def test_a_checkpoint_of_another_learner_is_refused(
    name: str, array: np.ndarray | None, message: str, saved: Checkpoint, trained: Trained
) -> None:
    arrays = {key: value for key, value in saved.arrays.items() if key != name}
    if array is not None:
        arrays[name] = array
    with pytest.raises(InputError, match=message):
        restore(trained[2].learner, replace(saved, arrays=arrays), Path("c.checkpoint"))


def test_a_checkpoint_is_what_it_says(saved: Checkpoint, trained: Trained, tmp_path: Path) -> None:
    restore(trained[2].learner, saved, tmp_path)
    wrong = replace(saved, random=(9999.0, 0.0, 0.0))
    with pytest.raises(InputError, match="random: expected a place up to 624"):
        restore(trained[2].learner, wrong, tmp_path)
    poisoned = {**saved.arrays, WEIGHT: np.full((3, 8), np.inf, np.float32)}
    path = replace(saved, arrays=poisoned).save(tmp_path)
    with pytest.raises(InputError, match=r"weight\.action_net\.weight\.npy: expected finite"):
        read_checkpoint(path)
    (tmp_path / "other.checkpoint").write_bytes(trained[0].last.read_bytes())
    with pytest.raises(InputError, match="a header of format 'albot-checkpoint'"):
        read_checkpoint(tmp_path / "other.checkpoint")


def test_a_full_disk_leaves_whole_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = EpisodeLog(tmp_path / "monitor.csv", "Albot/Homing-v0")
    file.add([(1.5, 10, 0.25, 1.0, None)])
    whole = file.size

    def full(stream: Any, content: bytes) -> None:
        stream.write(content[:5])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(run_files, "_write_all", full)
        with pytest.raises(InputError, match="No space left on device"):
            file.add([(2.0, 3, 0.5)])
    assert (tmp_path / "monitor.csv").stat().st_size == file.size == whole
    file.add([(2.0, 3, 0.5)])
    lines = (tmp_path / "monitor.csv").read_text().splitlines()
    assert lines[2:] == ["1.5,10,0.25,1,", "2,3,0.5"]
    with pytest.raises(InputError, match="999 bytes or more"):
        EpisodeLog(tmp_path / "monitor.csv", "Albot/Homing-v0", 999)


def test_the_curve_of_its_episodes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_files, "POINTS", 2)
    file = EpisodeLog(tmp_path / "monitor.csv", "Albot/Explore-v0")
    assert file.curve == {}
    file.add([(1.0, 10, 0.1), (3.0, 20, 0.2), (-4.0, 5, 0.3)])
    assert file.curve == {"samples": [30.0, 35.0], "return": [2.0, -4.0]}


def test_a_write_in_parts_is_whole() -> None:
    class Slow:
        """Takes three bytes at a time."""

        taken = b""

        def write(self, content: bytes) -> int:
            self.taken += content[:3]
            return min(3, len(content))

    stream: Any = Slow()
    run_files._write_all(stream, b"0123456789")
    assert stream.taken == b"0123456789"
