"""Trainings that begin with the cloning of an agent, end to end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytest.importorskip("torch")

from albot_agents.agent import EnvironmentConfigs, begin_episode
from albot_agents.registry import make_agent
from albot_agents.task import single_env_settings
from albot_agents.trained.agent_file import read_agent
from albot_agents.training import plan as plans
from albot_agents.training.checkpoint import read_checkpoint
from albot_agents.training.cloning import Cloner
from albot_agents.training.demonstrations import Demonstrations, Lesson, read_demonstrations
from albot_agents.training.evaluations import Evaluations
from albot_agents.training.plan_file import first_world, pretraining_settings, read_plan
from albot_agents.training.pretrain_plan import PretrainPlan
from albot_agents.training.pretraining import Pretraining
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_agents.training.teachers import TaughtEnvironments
from albot_core.errors import InputError
from albot_env.tasks.homing.task import HomingConfig
from tests.agents.training import tiny
from tests.agents.training.tiny import TASK, plan_file

PRETRAIN = {"agent": "albot1-homing", "steps": 40, "n_envs": 4, "n_epochs": 1, "batch_size": 16}
DAGGER = {**PRETRAIN, "rounds": 2}
LEARNER = {"parts": ["motion", "home"]}
"""What the learner observes: too little for its teachers."""
CHANGES: dict[str, Any] = {
    "pretrain": DAGGER,
    "evaluation": None,
    "env": {"config": {"observations": LEARNER}},
}


def begun(folder: Path, **changes: Any) -> tuple[RunFolder, Any]:
    """A run that is about to begin, in a new folder, and its plan."""
    folder.mkdir(exist_ok=True)
    return tiny.begun(folder, **changes)


def _made(folder: RunFolder, plan: Any) -> Demonstrations:
    settings = first_world(pretraining_settings(plan))
    batch: Any = gymnasium.make_vec(plan.task, num_envs=1, **settings).unwrapped
    batch.close()
    return read_demonstrations(folder.demonstrations, Lesson.of(plan.task, settings, batch), 6)


def _weights(folder: RunFolder, samples: int) -> dict[str, np.ndarray]:
    return read_checkpoint(folder.checkpoints / f"{samples:012d}.checkpoint").weights


def test_a_run_that_was_killed_while_it_cloned_goes_on_as_if_it_had_not_been(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, plan = begun(tmp_path / "whole", **CHANGES, n_timesteps=16)
    result = TrainingRun(whole, plan).run()
    assert result["samples"] == 16  # The demonstrations do not count.
    assert result["pretraining"]["samples"] == 40
    kept = read_agent(whole.last).training.plan.pretrain
    assert kept is not None
    assert (kept.agent, kept.rounds) == ("albot1-homing", 2)
    made = _made(whole, plan)
    assert (made.rounds, made.observations.shape) == (2, (8, 5, 6))
    assert made.begins[:, 0].all()

    killed, plan = begun(tmp_path / "killed", **CHANGES, n_timesteps=16)
    learn, demonstrate = Cloner.learn, Pretraining._demonstrate
    rounds: list[int] = []

    def stop(*arguments: Any) -> dict[str, float]:
        if len(rounds) == 2:
            raise KeyboardInterrupt
        return learn(*arguments)

    monkeypatch.setattr(
        Pretraining,
        "_demonstrate",
        lambda its, envs, k, report: (rounds.append(k), demonstrate(its, envs, k, report))[1],
    )
    monkeypatch.setattr(Cloner, "learn", stop)
    result = TrainingRun(killed, plan).run()
    assert result["stopped"]
    assert result["checkpoint"] is None  # Nothing that looks like a clone.
    monkeypatch.setattr(Cloner, "learn", learn)
    _made(killed, plan).first(1).save(killed.demonstrations)  # Killed before the second was saved.
    rounds.clear()
    TrainingRun(killed, killed.resume(None)).run()
    assert rounds == [1]
    assert killed.demonstrations.read_bytes() == whole.demonstrations.read_bytes()
    for samples in (0, 16):  # After the pretraining, and after an update that followed.
        expected = _weights(whole, samples)
        for name, weight in _weights(killed, samples).items():
            np.testing.assert_array_equal(weight, expected[name], err_msg=name)

    killed.demonstrations.unlink()  # They are needed no more.
    rounds.clear()
    TrainingRun(killed, killed.resume(None, n_timesteps=32)).run()
    assert not rounds


@pytest.mark.parametrize(
    ("agent", "changes"),
    [
        ("oracle", {"env": {"action": "discrete"}, "policy": {"initial_action": None}}),
        ("random", {"algorithm": "recurrent_ppo", "policy": {"lstm_size": 4}}),
    ],
)
def test_who_knows_the_truth_and_whoever_acts_otherwise_can_be_cloned(
    agent: str, changes: dict[str, Any], tmp_path: Path
) -> None:
    folder, plan = begun(
        tmp_path, pretrain={**PRETRAIN, "agent": agent}, evaluation=None, n_timesteps=16, **changes
    )
    figures = TrainingRun(folder, plan).run()["pretraining"]
    assert figures["samples"] == 40
    assert np.isfinite(figures["log_likelihood"])


@pytest.mark.parametrize(("longest", "warnings"), [(3, 0), (100, 1)])
def test_demonstrations_without_the_end_of_an_episode_are_told(
    longest: int, warnings: int, tmp_path: Path
) -> None:
    env = {**CHANGES["env"], "max_episode_steps": longest}
    folder, plan = begun(tmp_path, **{**CHANGES, "env": env}, n_timesteps=16)
    told: list[str] = []
    TrainingRun(folder, plan, told.append).run()
    assert len(told) == warnings
    assert all("no episode ended within the 5 steps of a round" in text for text in told)


def test_a_clone_is_evaluated_before_it_learns_by_itself(tmp_path: Path) -> None:
    folder, plan = begun(tmp_path, pretrain=PRETRAIN, n_timesteps=16)
    TrainingRun(folder, plan).run()
    with np.load(folder.evaluations) as kept:
        assert kept["timesteps"].tolist() == [0, 16]


def test_a_clone_whose_evaluation_was_stopped_is_evaluated_after_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, plan = begun(tmp_path, pretrain=PRETRAIN, n_timesteps=16)
    with monkeypatch.context() as patched:
        patched.setattr(Evaluations, "measure", _interrupted)
        assert TrainingRun(folder, plan).run()["stopped"]
    TrainingRun(folder, folder.resume(None)).run()
    with np.load(folder.evaluations) as kept:
        assert kept["timesteps"].tolist() == [0, 16]


def _interrupted(*_: Any) -> bool:
    raise KeyboardInterrupt


def test_a_trained_teacher_drives_at_the_scales_of_the_learner(tmp_path: Path) -> None:
    """Otherwise it would drive elsewhere than the robot whose observations are learnt."""
    slow = {"config": {"actions": {"speed": 0.4}, "observations": LEARNER}}
    taught, plan = begun(tmp_path / "slow", env=slow, n_timesteps=16, evaluation=None)
    TrainingRun(taught, plan).run()
    pretrain = {**PRETRAIN, "agent": str(taught.last)}
    with pytest.raises(InputError, match=r"pretrain.agent: expected actions as .*speed 1.0, not 0"):
        begun(tmp_path / "fast", **CHANGES | {"pretrain": pretrain})
    begun(tmp_path / "equal", env=slow, pretrain=pretrain)


def test_teachers_draw_anew_in_each_episode_and_by_the_seed(tmp_path: Path) -> None:
    plan = read_plan(plan_file(tmp_path / "plan.yml", **CHANGES))
    envs = TaughtEnvironments(TASK, "random", 2, pretraining_settings(plan))
    drawn = []
    for seed in (5, 5, 6):
        envs.reset(seed)
        drawn.append(envs.demonstrate())
        envs._teachers.reset(np.ones(2, np.bool_))
        drawn.append(envs.demonstrate())
    envs.close()
    np.testing.assert_array_equal(drawn[0], drawn[2])
    for other in (1, 4):
        assert (drawn[0] != drawn[other]).any()


def test_a_learner_sees_its_own_part_of_the_episodes_of_its_teachers(tmp_path: Path) -> None:
    """A batch without teachers that acts as they do observes the same, and is rewarded alike."""
    plan = read_plan(plan_file(tmp_path / "plan.yml", **CHANGES))
    settings = pretraining_settings(plan)
    envs = TaughtEnvironments(TASK, "albot1-homing", 2, settings)
    alone: Any = gymnasium.make_vec(TASK, num_envs=2, autoreset_mode="SameStep", **settings)
    seen, (expected, _) = envs.reset(5), alone.reset(seed=5)
    for _ in range(15):  # Past the end of an episode.
        np.testing.assert_array_equal(seen, expected)
        actions = envs.demonstrate()
        seen, rewards, *_ = envs.step(actions)
        expected, wanted, *_ = alone.step(actions)
        np.testing.assert_array_equal(rewards, wanted)
    assert set(envs._seen) > {"motion", "home"}
    envs.reset(5)
    shown = HomingConfig().observations
    whole = {**settings, "config": replace(settings["config"], observations=shown)}
    single = gymnasium.make(TASK, **single_env_settings(TASK, whole), observation="dict")
    agent = make_agent("albot1-homing", EnvironmentConfigs.of(single))
    for k, told in enumerate(envs.demonstrate()):
        observation, info = begin_episode(single, agent, 5 + k)
        np.testing.assert_array_equal(envs._seen["laser"][k], observation["laser"])
        np.testing.assert_array_equal(told, agent.act(observation, info))
    envs.close()
    alone.close()


def test_in_later_rounds_the_policy_drives_and_the_agent_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the second of two rounds with beta 0.25, the agent drives one of four."""
    driven: list[Any] = []
    step = TaughtEnvironments.step
    monkeypatch.setattr(
        TaughtEnvironments,
        "step",
        lambda its, actions: (driven.append(np.array(actions)), step(its, actions))[1],
    )
    folder, plan = begun(tmp_path, **CHANGES | {"pretrain": {**DAGGER, "beta": 0.25}})
    TrainingRun(folder, plan).run()
    told = _made(folder, plan).actions
    did = np.stack(driven, axis=1)
    np.testing.assert_array_equal(did[:, :5], told[:4])
    np.testing.assert_array_equal(did[0, 5:], told[4])
    assert (did[1:, 5:] != told[5:]).any(axis=(1, 2)).all()


def test_demonstrations_of_another_kind_are_told_before_anything_is_written(tmp_path: Path) -> None:
    folder, plan = begun(tmp_path / "first", **CHANGES)
    TrainingRun(folder, plan).run()
    file = str(folder.demonstrations)

    def refused(**changes: Any) -> str:
        given = {"demonstrations": file}
        path = plan_file(tmp_path / "second.yml", **CHANGES | {"pretrain": given} | changes)
        with pytest.raises(InputError) as error:
            read_plan(path)
        return str(error.value)

    seen = {"config": {"observations": {**LEARNER, "home_range": 50}}}
    assert f"{file}, header.json, observations: expected" in (message := refused(env=seen))
    assert "home_range 100" in message
    acts = {"config": {"observations": LEARNER, "actions": {"speed": 0.5}}}
    assert "header.json, actions: expected the actions of the plan, found speed" in refused(
        env=acts
    )
    task = {"task": "Albot/HomingByMap-v0", "policy": {"initial_action": None}}
    assert "header.json, task: expected Albot/HomingByMap-v0, found Albot/Homing-v0" in refused(
        **task
    )
    mapper = {"mapper": "odometry", "config": {"observations": LEARNER}}
    assert "header.json, mapper: expected odometry, found none" in refused(env=mapper)

    given = {"demonstrations": file, "n_epochs": 1}
    again, plan = begun(tmp_path / "third", **CHANGES | {"pretrain": given, "n_timesteps": 16})
    assert TrainingRun(again, plan).run()["pretraining"]["samples"] == 40
    assert not again.demonstrations.exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pretrain": {"agent": "albot1-homin"}}, "did you mean albot1-homing"),
        ({"pretrain": {"agent": "gap-explorer"}}, "pretrain.agent: expected one for Albot/Homing"),
        (
            {"pretrain": PRETRAIN, "env": {"laser": "none"}},
            "pretrain.agent: expected observations with the part laser",
        ),
        ({"pretrain": {}}, "pretrain.agent: expected an agent, or demonstrations instead"),
        ({"pretrain": {**PRETRAIN, "steps": 3}}, "pretrain.steps: expected at least one of each"),
        ({"pretrain": {**PRETRAIN, "steps": 10**10}}, "pretrain.steps: expected at most"),
        (
            {"pretrain": {"demonstrations": "a", "rounds": 2}},
            "pretrain.rounds: expected 1, because",
        ),
        ({"pretrain": {"demonstrations": "none.npz"}}, "none.npz"),
        ({"pretrain": {**PRETRAIN, "env": {"laser": "x"}}}, "pretrain.env.laser"),
    ],
)
def test_what_cannot_be_learnt_from_is_told(
    changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        read_plan(plan_file(tmp_path / "plan.yml", **changes))


def test_only_actor_critics_are_pretrained(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plans, "ALGORITHMS", (*plans.ALGORITHMS, "sac"))
    pretrain = PretrainPlan(agent="oracle")
    plans.TrainingPlan(task=TASK, pretrain=pretrain)
    with pytest.raises(InputError, match="pretrain: expected null for sac"):
        plans.TrainingPlan(task=TASK, algorithm="sac", pretrain=pretrain)
