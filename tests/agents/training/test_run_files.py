"""Checkpoints and monitor files: what is wrong with one is refused, and no write is left half."""

from __future__ import annotations

import errno
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_agents.training import run_files
from albot_agents.training.checkpoint import Checkpoint, checkpoints, read_checkpoint, restore
from albot_agents.training.evaluations import Evaluations
from albot_agents.training.run import TrainingRun
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
    for random in ((9999.0, 0.0, 0.0), (3.0, 1e300, 0.0)):
        with pytest.raises(InputError, match="random: expected a position up to 624"):
            restore(trained[2].learner, replace(saved, numpy_state=random), tmp_path)
    scrambled = {**saved.arrays, "random.torch": saved.arrays["random.torch"] * 0 + 255}
    with pytest.raises(InputError, match=r"random\.torch\.npy: expected a generator's state"):
        restore(trained[2].learner, replace(saved, arrays=scrambled), tmp_path)
    poisoned = {**saved.arrays, WEIGHT: np.full((3, 8), np.inf, np.float32)}
    path = replace(saved, arrays=poisoned).save(tmp_path)
    with pytest.raises(InputError, match=r"weight\.action_net\.weight\.npy: expected finite"):
        read_checkpoint(path)
    (tmp_path / "other.checkpoint").write_bytes(trained[0].last.read_bytes())
    with pytest.raises(InputError, match="a header of format albot-checkpoint"):
        read_checkpoint(tmp_path / "other.checkpoint")


def test_a_full_disk_leaves_whole_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = EpisodeLog(tmp_path / "monitor.csv", "Albot/Homing-v0")
    file.add([(1.5, 10, 0.25, 1.0, None)])
    whole = file.size

    def full(stream: Any, content: bytes) -> None:
        stream.write(content[:5])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(run_files, "write_all", full)
        with pytest.raises(InputError, match="No space left on device"):
            file.add([(2.0, 3, 0.5)])
    assert (tmp_path / "monitor.csv").stat().st_size == file.size == whole
    file.add([(2.0, 3, 0.5)])
    lines = (tmp_path / "monitor.csv").read_text().splitlines()
    assert lines[2:] == ["1.5,10,0.25,1,", "2,3,0.5"]
    with pytest.raises(InputError, match="999 bytes or more"):
        EpisodeLog(tmp_path / "monitor.csv", "Albot/Homing-v0", 999)
    (tmp_path / "monitor.csv").unlink()
    with pytest.raises(InputError, match=r"monitor\.csv: file not found"):
        EpisodeLog(tmp_path / "monitor.csv", "Albot/Homing-v0", whole)


def test_the_curve_of_its_episodes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_files, "POINTS", 2)
    file = EpisodeLog(tmp_path / "monitor.csv", "Albot/Explore-v0")
    assert file.curve == {}
    file.add([(1.0, 10, 0.1), (3.0, 20, 0.2), (-4.0, 5, 0.3)])
    assert file.curve == {"samples": [30.0, 35.0], "return": [2.0, -4.0]}


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"1.5", "monitor.csv: expected a line r,l,t,"),
        (b"1.5,x,0.2", "monitor.csv: expected a line r,l,t,"),
        (b"\xff\xfe", "monitor.csv: expected a line r,l,t,"),
        (b"1.5,inf,0.2", "monitor.csv: expected finite numbers"),
    ],
)
def test_a_damaged_log_of_episodes_is_refused(line: bytes, message: str, tmp_path: Path) -> None:
    file = EpisodeLog(tmp_path / "monitor.csv", "Albot/Explore-v0")
    file.add([(1.0, 10, 0.1)])
    content = (tmp_path / "monitor.csv").read_bytes() + line + b"\n"
    (tmp_path / "monitor.csv").write_bytes(content)
    with pytest.raises(InputError, match=message):
        EpisodeLog(tmp_path / "monitor.csv", "Albot/Explore-v0", len(content))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b'{"command": "albot tr', "versions.json, line 1: expected valid JSON"),
        (b'"\xff"', "versions.json, line 1: expected UTF-8 text"),
        (b"[]", "versions.json: expected a mapping with command"),
        (b"{}", "versions.json, command: expected a value, found none"),
        (b'{"command": 3}', "versions.json, command: expected text, found 3"),
    ],
)
def test_a_damaged_file_of_versions_is_refused_on_resume(
    content: bytes, message: str, trained: Trained
) -> None:
    folder, plan, _, _ = trained
    whole = folder.versions.read_bytes()
    try:
        folder.versions.write_bytes(content)
        with pytest.raises(InputError, match=message):
            TrainingRun(folder, plan)
    finally:
        folder.versions.write_bytes(whole)


def _saved(**changed: np.ndarray | None) -> bytes:
    """A file of evaluations of one episode each, with other arrays."""
    arrays = {name: np.zeros((2, 1)) for name in ("results", "successes", "spl")}
    arrays |= {"timesteps": np.arange(2), "ep_lengths": np.ones((2, 1), np.int64)}
    kept = {name: array for name, array in (arrays | changed).items() if array is not None}
    stream = io.BytesIO()
    np.savez(stream, **kept)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04", "evaluations.npz: expected an intact file of evaluations"),
        (_saved(spl=None), "expected the arrays timesteps, results"),
        (_saved(more=np.zeros(2)), "expected the arrays timesteps, results"),
        (_saved(spl=np.zeros((2, 3))), r"spl\.npy: expected \(2, 1\) of float64"),
        (_saved(spl=np.zeros((2, 1), np.int8)), r"spl\.npy: expected \(2, 1\) of float64"),
        (_saved(timesteps=np.array(3)), r"timesteps\.npy: expected"),
        (_saved(timesteps=np.array([{}], object)), "expected an array of numbers"),
    ],
)
def test_damaged_evaluations_are_refused(
    content: bytes, message: str, trained: Trained, tmp_path: Path
) -> None:
    path = tmp_path / "evaluations.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        Evaluations(trained[1], path, 64)
    path.write_bytes(_saved())
    Evaluations(trained[1], path, 64).close()


def test_a_write_in_parts_is_whole(tmp_path: Path) -> None:
    class Slow(io.FileIO):
        def write(self, content: Any) -> int:
            return super().write(content[:3])

    with Slow(tmp_path / "file", "wb") as stream:
        run_files.write_all(stream, b"0123456789")
    assert (tmp_path / "file").read_bytes() == b"0123456789"
