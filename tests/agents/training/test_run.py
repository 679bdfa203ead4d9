"""A run: what it writes, and that it can be stopped and resumed at any moment."""

from __future__ import annotations

import csv
import dataclasses
import errno
import json
import shutil
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.spaces import Box

from albot_agents.registry import make_agent
from albot_agents.trained.agent_file import read_agent
from albot_agents.training.checkpoint import (
    checkpoints,
    newest_checkpoint,
    read_checkpoint,
    take_checkpoint,
)
from albot_agents.training.curriculum import Curriculum
from albot_agents.training.evaluations import Evaluations
from albot_agents.training.plan_file import read_plan, stage_settings
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder, free_folder
from albot_core.archive import ArchiveFormat
from albot_core.errors import InputError
from tests.agents.training.conftest import Trained
from tests.agents.training.tiny import TASK, begun


def _again(folder: RunFolder, tmp_path: Path) -> RunFolder:
    """A copy of a run's folder."""
    return RunFolder(Path(shutil.copytree(folder.path, tmp_path / "again")))


def test_the_folder_holds_all(trained: Trained) -> None:
    folder, plan, _, result = trained
    assert {path.name for path in folder.path.iterdir()} == {
        "best.albot", "checkpoints", "config.yml", "evaluations.npz", "last.albot", "monitor.csv",
        "tensorboard", "versions.json",
    }  # fmt: skip
    assert read_plan(folder.plan) == plan
    assert json.loads(folder.versions.read_text())["versions"].keys() > {"numpy", "torch"}
    assert any(folder.tensorboard.iterdir())
    assert (result["samples"], result["stopped"]) == (64, False)
    assert json.dumps(result)
    # The newest two, and nothing half-written beside them.
    names = [path.name for path in sorted(folder.checkpoints.iterdir())]
    assert names == ["000000000032.checkpoint", "000000000064.checkpoint"]


def test_episodes_stand_in_the_monitor_file(trained: Trained) -> None:
    folder, _, _, result = trained
    first, *lines = folder.monitor.read_text().splitlines()
    assert json.loads(first.removeprefix("#"))["env_id"] == TASK
    rows = list(csv.DictReader(lines))
    assert len(rows) == result["episodes"] > 0
    assert {"r", "l", "t", "is_success", "spl"} <= rows[0].keys()
    assert all(1 <= int(row["l"]) <= 12 for row in rows)
    assert sum(int(row["l"]) for row in rows) <= 64


def test_evaluations_are_those_of_eval_callback(trained: Trained) -> None:
    with np.load(trained[0].evaluations, allow_pickle=False) as found:
        assert found["timesteps"].tolist() == [32, 64]
        assert found["results"].shape == found["ep_lengths"].shape == (2, 1)
        assert np.isin(found["successes"], (0, 1)).all()


class _Drawn:
    """A policy whose mean action drives straight on, and draws of which declare home at once."""

    def __init__(self) -> None:
        self.drawn: list[float] = []

    def predict(
        self, observations: Any, state: Any, starts: Any, *, deterministic: bool
    ) -> tuple[np.ndarray, Any]:
        if deterministic:
            return np.tile((0.5, 0.0, -1.0), (len(starts), 1)), state
        self.drawn += torch.rand(len(starts)).tolist()
        return np.tile((0.5, self.drawn[-1], 1.0), (len(starts), 1)), state


@pytest.mark.parametrize("sampled_statements", [False, True])
def test_an_evaluation_draws_as_the_agent_does(
    trained: Trained,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    sampled_statements: bool,
) -> None:
    plan, drawn = trained[1], _Drawn()
    monkeypatch.setattr(trained[2].learner.policy, "predict", drawn.predict)
    assert plan.evaluation is not None
    plan = dataclasses.replace(
        plan,
        policy=dataclasses.replace(
            plan.policy, sampled=True, sampled_statements=sampled_statements
        ),
        evaluation=dataclasses.replace(plan.evaluation, deterministic=False),
    )
    evaluations = Evaluations(plan, tmp_path / "evaluations.npz", 0)
    before = torch.random.get_rng_state()
    for _ in range(2):
        evaluations.measure(trained[2].learner)
    assert torch.equal(torch.random.get_rng_state(), before)
    evaluations.close()
    with np.load(tmp_path / "evaluations.npz") as found:
        first, second = found["ep_lengths"]
        assert (first == second).all()
        assert (first == 1).all() == sampled_statements  # A declaration ends the episode.
    half = len(drawn.drawn) // 2
    assert drawn.drawn[:half] == drawn.drawn[half:]


def test_an_evaluation_takes_the_mean_unless_it_is_told_otherwise(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = _Drawn()
    monkeypatch.setattr(trained[2].learner.policy, "predict", drawn.predict)
    plan = dataclasses.replace(
        trained[1], policy=dataclasses.replace(trained[1].policy, sampled=True)
    )
    evaluations = Evaluations(plan, tmp_path / "evaluations.npz", 0)
    evaluations.measure(trained[2].learner)
    evaluations.close()
    assert not drawn.drawn


def test_a_resumed_run_goes_on_from_what_was_saved(trained: Trained, tmp_path: Path) -> None:
    folder = _again(trained[0], tmp_path)
    saved = read_checkpoint(checkpoints(folder.checkpoints)[-1])
    run = TrainingRun(folder, folder.resume(TASK, n_timesteps=96))
    restored = take_checkpoint(run.learner, saved.run)
    assert (restored.samples, restored.updates) == (saved.samples, saved.updates) == (64, 4)
    assert restored.numpy_state == saved.numpy_state
    assert restored.arrays.keys() == saved.arrays.keys()
    assert any(name.startswith("adam.exp_avg_sq.") for name in saved.arrays)
    for name, array in saved.arrays.items():
        np.testing.assert_array_equal(restored.arrays[name], array)
    result = run.run()
    assert result["samples"] == 96
    assert result["episodes"] > trained[3]["episodes"]
    with np.load(folder.evaluations) as found:
        assert found["timesteps"].tolist() == [32, 64, 96]
    lines = folder.monitor.read_text().splitlines()
    assert len(lines) == 2 + result["episodes"]
    assert run.learner.lr_schedule(1 - 64 / 96) == pytest.approx(3e-4 / 3)


def test_what_came_after_the_checkpoint_is_let_go(trained: Trained, tmp_path: Path) -> None:
    folder = _again(trained[0], tmp_path)
    checkpoints(folder.checkpoints)[-1].unlink()
    before = read_checkpoint(checkpoints(folder.checkpoints)[-1])
    with folder.monitor.open("a") as stream:
        stream.write("1.5,3")  # As a process that was killed may leave it.
    (folder.checkpoints / ".000000000064.checkpoint.x1").write_bytes(b"half")
    run = TrainingRun(folder, folder.resume(None))
    assert run.learner.num_timesteps == 32
    assert folder.monitor.stat().st_size == before.run["monitor"]
    assert [path.name[0] for path in folder.checkpoints.iterdir()] == ["0"]
    assert run.run()["samples"] == 64
    with np.load(folder.evaluations) as found:
        assert found["timesteps"].tolist() == [32, 64]


def test_a_torn_checkpoint_gives_way_to_the_one_before(trained: Trained, tmp_path: Path) -> None:
    folder = _again(trained[0], tmp_path)
    older, newest = checkpoints(folder.checkpoints)
    newest.write_bytes(newest.read_bytes()[:-40])
    notes: list[str] = []
    run = TrainingRun(folder, folder.resume(None), notes.append)
    assert run.learner.num_timesteps == 32
    assert len(notes) == 1
    assert str(newest) in notes[0]
    older.write_bytes(b"")
    with pytest.raises(InputError, match="an intact checkpoint"):
        TrainingRun(folder, folder.resume(None), notes.append)


def test_fewer_samples_than_are_done_are_refused(trained: Trained, tmp_path: Path) -> None:
    folder = _again(trained[0], tmp_path)
    left = folder.checkpoints / ".000000000064.checkpoint.x1"
    left.write_bytes(b"half")
    before = {path: path.read_bytes() for path in folder.path.rglob("*") if path.is_file()}
    expected = r"again, --steps: expected at least the 64 samples that are done.* found 63$"
    with pytest.raises(InputError, match=expected):
        folder.resume(None, n_timesteps=63)
    assert before == {path: path.read_bytes() for path in folder.path.rglob("*") if path.is_file()}
    assert folder.resume(None, n_timesteps=64).n_timesteps == 64
    # Where the newest checkpoint is damaged, only the samples of the one before are done.
    checkpoints(folder.checkpoints)[-1].write_bytes(b"")
    assert folder.resume(None, n_timesteps=48).n_timesteps == 48
    with pytest.raises(InputError, match="the 32 samples"):
        folder.resume(None, n_timesteps=31)


def test_ctrl_c_saves_what_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, plan = begun(tmp_path, evaluation=None, checkpoint_every=1000)
    run = TrainingRun(folder, plan)
    train, calls = run.learner.train, []

    def interrupted() -> None:
        calls.append(run.learner.num_timesteps)
        if len(calls) == 3:
            raise KeyboardInterrupt
        train()

    monkeypatch.setattr(run.learner, "train", interrupted)
    result = run.run()
    assert result["stopped"]
    assert calls == [16, 32, 48]
    # The third update was not made, so its samples do not count.
    assert result["samples"] == 32
    assert [path.stem for path in checkpoints(folder.checkpoints)] == ["000000000032"]
    assert read_agent(folder.last).training.samples == 32
    assert TrainingRun(folder, folder.resume(None)).run()["samples"] == 64


def test_a_full_disk_is_told_with_the_last_good_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, plan = begun(tmp_path, evaluation=None)
    write = ArchiveFormat.write

    def full(its: ArchiveFormat, path: Path, header: Any, arrays: Any) -> None:
        if path.name.startswith("000000000064"):
            raise OSError(errno.ENOSPC, "No space left on device")
        write(its, path, header, arrays)

    monkeypatch.setattr(ArchiveFormat, "write", full)
    good = "000000000032.checkpoint"
    with pytest.raises(InputError, match=rf"No space left on device; .*{good} is intact"):
        TrainingRun(folder, plan).run()
    assert [path.name for path in folder.checkpoints.iterdir()] == [good]


def test_the_same_seed_gives_the_same_agent(trained: Trained, tmp_path: Path) -> None:
    folder, plan = begun(tmp_path)
    TrainingRun(folder, plan).run()
    one, other = read_agent(trained[0].last), read_agent(folder.last)
    for name, array in one.weights.items():
        np.testing.assert_array_equal(array, other.weights[name])


def test_observations_by_part_train_the_same_agent(trained: Trained, tmp_path: Path) -> None:
    """It sees what `FlattenObservation` makes of them, and acts by either form."""
    folder, plan = begun(tmp_path, env={"observation": "dict"})
    TrainingRun(folder, plan).run()
    env: Any = gymnasium.make_vec(
        plan.task,
        num_envs=2,
        **stage_settings(plan, plan.stages[0]) | {"observation": "dict"},
    )
    parts, _ = env.reset(seed=[plan.seed, plan.seed + 1])
    space = env.single_observation_space
    rows = [
        spaces.flatten(space, {name: part[k] for name, part in parts.items()}) for k in range(2)
    ]
    course = Curriculum(plan, 0)
    course.seed(plan.seed)
    np.testing.assert_array_equal(course.reset(), rows)
    course.close()
    assert read_plan(folder.plan).env["observation"] == "dict"
    for name in ("last", "best"):
        one, other = (read_agent(getattr(its, name)) for its in (trained[0], folder))
        for weight, array in one.weights.items():
            np.testing.assert_array_equal(array, other.weights[weight])
        assert one.fingerprint == other.fingerprint
    agent = make_agent(str(folder.last))
    agent.reset(np.random.default_rng(0), env.single_action_space)
    by_part = {name: part[0] for name, part in parts.items()}
    np.testing.assert_array_equal(agent.act(by_part, {}), agent.act(rows[0], {}))
    env.close()


def test_a_curriculum_moves_on(tmp_path: Path) -> None:
    stages = [
        {"env": {"odometer": "ideal"}, "for_steps": 32},
        {"env": {"max_episode_steps": 2}, "until_success": 0.5},
        {},
    ]
    folder, plan = begun(tmp_path, curriculum=stages, evaluation=None)
    # The second stage never ends: nobody comes home.
    assert TrainingRun(folder, plan).run()["stage"] == 1
    lines = folder.monitor.read_text().splitlines()[2:]
    lengths = [int(line.split(",")[1]) for line in lines]
    assert max(lengths[:3]) > 2
    assert set(lengths[-8:]) <= {1, 2}
    again = TrainingRun(folder, folder.resume(None, n_timesteps=80))
    assert again.run()["stage"] == 1


def test_the_best_agent_acts(trained: Trained) -> None:
    agent = make_agent(str(trained[0].best))
    assert not agent.knows_truth
    assert read_agent(trained[0].best).training.samples in (32, 64)


def test_an_agent_may_draw_its_numbers_and_do_the_same_again(tmp_path: Path) -> None:
    policy = {"net_arch": [8], "initial_action": [0.2, 0, 0], "sampled": True}
    folder, plan = begun(tmp_path, policy=policy)
    TrainingRun(folder, plan).run()
    spread = np.exp(read_agent(folder.last).weights["action.log_std"])
    agent, actions = make_agent(str(folder.last)), Box(-1, 1, (3,), np.float32)
    (length,) = read_agent(folder.last).observation_config.flat_space.shape  # type: ignore[union-attr]
    seen, drawn = np.zeros(length, np.float32), []
    for seed in (1, 1, 2):
        agent.reset(np.random.default_rng(seed), actions)
        drawn.append([agent.act(seen, {}) for _ in range(300)])
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])
    assert np.abs(drawn).max() <= 1.0
    assert np.std(drawn[0], axis=0)[1] == pytest.approx(spread[1], rel=0.3)


def test_of_discrete_actions_none_is_drawn(tmp_path: Path) -> None:
    policy = {"net_arch": [8], "initial_action": None}
    folder, plan = begun(tmp_path, policy=policy, env={"action": "discrete"})
    sampled = dataclasses.replace(plan.policy, sampled=True)
    with pytest.raises(InputError, match=r"training plan, policy\.sampled: expected false for"):
        TrainingRun(folder, dataclasses.replace(plan, policy=sampled))


def test_a_run_is_not_begun_twice_in_a_folder(trained: Trained, tmp_path: Path) -> None:
    folder, plan, *_ = trained
    with pytest.raises(InputError, match="without a run"):
        folder.begin(plan, "")
    with pytest.raises(InputError, match="the folder of a training run"):
        RunFolder(tmp_path).resume(None)
    with pytest.raises(InputError, match="task: expected Albot/Explore-v0"):
        folder.resume("Albot/Explore-v0")
    (tmp_path / "Homing-v0-ppo-1").mkdir()
    other, _ = begun(tmp_path)
    other.begin(plan, "")  # Nothing has come of it yet.
    assert free_folder(tmp_path, plan).name == "Homing-v0-ppo-2"


@pytest.mark.parametrize("moment", ["update", "rollout"])
def test_a_training_that_diverges_is_one_clear_error(
    moment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, plan = begun(tmp_path)
    run = TrainingRun(folder, plan)
    train = run.learner.train

    def diverge() -> None:
        if moment == "update":
            train()
        if run.learner.num_timesteps == 48:
            with torch.no_grad():
                run.learner.policy.action_net.weight[0, 0] = float("nan")  # type: ignore[union-attr, operator]
            if moment == "update":
                train()

    monkeypatch.setattr(run.learner, "train", diverge)
    good = r"000000000032\.checkpoint is intact"
    # Where distributions check no parameters, as torchrl decides for the process, all become NaN.
    bad = r"within ±(1e\+06|20); .* (action_net|log_std).* 48 samples"
    with pytest.raises(InputError, match=rf"{bad}; .*{good}$"):
        run.run()
    # What was saved before is whole.
    assert read_checkpoint(checkpoints(folder.checkpoints)[-1]).samples == 32
    assert read_agent(folder.last).training.samples == 32


def test_a_run_whose_checkpoints_are_gone_does_not_begin_anew(
    trained: Trained, tmp_path: Path
) -> None:
    folder = _again(trained[0], tmp_path)
    shutil.rmtree(folder.checkpoints)
    before = folder.monitor.read_bytes()
    with pytest.raises(InputError, match=r"checkpoints: expected the checkpoint of last\.albot"):
        folder.resume(TASK)
    assert folder.monitor.read_bytes() == before
    # One that was stopped before its first checkpoint does.
    folder.last.unlink()
    folder.resume(TASK)
    assert folder.checkpoints.is_dir()


def test_where_no_checkpoint_is_intact_none_is_promised(trained: Trained, tmp_path: Path) -> None:
    folder, notes = _again(trained[0], tmp_path), list[str]()
    newest, older = reversed(checkpoints(folder.checkpoints))
    newest.write_bytes(b"bad")
    assert newest_checkpoint(folder.checkpoints, notes.append)
    assert [text.partition("; ")[2] for text in notes] == ["continuing from the one before"]
    older.write_bytes(b"bad")
    with pytest.raises(InputError):
        newest_checkpoint(folder.checkpoints, notes.append)
    assert len(notes) == 1
