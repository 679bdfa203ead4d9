"""Plans for learners with a replay buffer: what does not fit is said before anything is written."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.spaces import Box, Discrete
from stable_baselines3.common.buffers import ReplayBuffer

from albot_agents.training import plan_check
from albot_agents.training.off_policy_plan import OFF_POLICY, USERS, OffPolicyPlan
from albot_agents.training.plan import ALGORITHMS, TrainingPlan
from albot_agents.training.plan_check import sample_bytes
from albot_agents.training.plan_file import plan_text, read_plan, save_plan, stage_settings
from albot_agents.training.run import TrainingRun
from albot_core.config_document import field_docs
from albot_core.errors import InputError
from tests.agents.training.tiny import begun, off_policy, plan_file


@pytest.mark.parametrize(
    ("algorithm", "changes", "message"),
    [
        (
            "dqn",
            {"env": {"action": "continuous"}},
            r"line \d+, algorithm: expected one of ppo, recurrent_ppo, sac for actions of 3 numbers"
            r"; dqn and qrdqn need env: {action: discrete}, found dqn$",
        ),
        (
            "sac",
            {"env": {"action": "discrete"}},
            r"line \d+, algorithm: expected one of ppo, recurrent_ppo, dqn, qrdqn for 11 discrete "
            "actions, found sac$",
        ),
        (
            "qrdqn",
            {"off_policy": {"buffer_size": 10**9}},
            r"line \d+, off_policy.buffer_size: expected at most [\d,]+ samples of [\d,]+ bytes, "
            "half of this machine's memory, found 1,000,000,000$",
        ),
        (
            "dqn",
            {"n_epochs": 8},
            r"line \d+, n_epochs: expected 4, the default, because dqn does not use it, found 8$",
        ),
        (
            "sac",
            {"n_steps": 8, "clip_range": 0.1, "max_grad_norm": 1},
            r"line \d+, n_steps: expected 32, .* found 8 \(and also clip_range, max_grad_norm\)$",
        ),
        (
            "sac",
            {"off_policy": {"n_quantiles": 7}},
            r"off_policy: expected n_quantiles 25, the default, because sac does not use it",
        ),
        (
            "dqn",
            {"off_policy": {"ent_coef": 0.1}},
            r"off_policy: expected ent_coef auto_0.1, .* dqn does not",
        ),
        (
            "dqn",
            {"policy": {"value_arch": [8]}},
            "policy: expected value_arch null, the default, .* dqn does not",
        ),
        ("sac", {"policy": {"sampled": True}}, "policy: expected sampled False, .* sac does not"),
        ("sac", {"policy": {"lstm_size": 4}}, "policy: expected lstm_size 128, .* sac does not"),
        ("dqn", {"policy": {"kind": "candidates"}}, "another kind than candidates for dqn"),
        (
            "sac",
            {"policy": {"initial_action": [0.5, 0, -1]}},
            r"line \d+, policy.initial_action: expected numbers within \(-1, 1\) for sac, .*-1",
        ),
        (
            "dqn",
            {"policy": {"initial_action": [0.5, 0]}},
            r"policy.initial_action: expected 11 numbers, found 2",
        ),
        ("sac", {"off_policy": {"buffer_size": 1}}, "expected a buffer_size of n_envs, 2, or more"),
        (
            "sac",
            {"off_policy": {"learning_starts": 160}},
            "off_policy: expected learning_starts below n_timesteps, 160, or nothing is learnt",
        ),
        ("sac", {"off_policy": {"tau": 0}}, r"line \d+, off_policy.tau: expected a number above 0"),
        ("sac", {"off_policy": {"ent_coef": "auto_0"}}, r"line \d+, off_policy.ent_coef: expected"),
        ("sac", {"off_policy": {"ent_coef": "auto_"}}, r"off_policy.ent_coef: .* auto_A with A"),
        ("sac", {"off_policy": {"ent_coef": -0.1}}, "off_policy.ent_coef: expected a number from"),
        ("dqn", {"off_policy": {"exploration_fraction": 0}}, "fraction: expected a number above 0"),
        ("dqn", {"off_policy": {"exploration_final_eps": 1.5}}, "final_eps: expected .* within"),
        ("dqn", {"off_policy": {"train_freq": 0}}, "train_freq: expected a whole number from 1"),
        ("dqn", {"off_policy": {"bufer_size": 9}}, "did you mean buffer_size"),
    ],
)
def test_what_does_not_fit_is_said_where_it_stands(
    algorithm: str, changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        read_plan(plan_file(tmp_path / "plan.yml", off_policy(algorithm), **changes))


def test_what_only_others_use_is_said_for_ppo_too(tmp_path: Path) -> None:
    own = {"learning_starts": 7}
    expected = r"off_policy: expected learning_starts 20000, the default, because ppo does not use"
    with pytest.raises(InputError, match=expected):
        read_plan(plan_file(tmp_path / "plan.yml", off_policy=own))


def test_what_is_saved_is_read_whatever_the_defaults_were(tmp_path: Path) -> None:
    """A later version may have other defaults of the fields that an algorithm does not use."""
    folder, plan = begun(tmp_path)
    older = dataclasses.replace(plan, off_policy=OffPolicyPlan(gradient_steps=77))
    save_plan(older, folder.plan)
    assert folder.check(None) == older
    with pytest.raises(InputError, match="expected gradient_steps"):
        read_plan(folder.plan)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_plan_of_defaults_is_read_back(algorithm: str, tmp_path: Path) -> None:
    """With all of its fields, also those of the other algorithms."""
    plan = TrainingPlan(task="Albot/Homing-v0", algorithm=algorithm)
    (tmp_path / "plan.yml").write_text(plan_text(plan), encoding="utf-8")
    assert read_plan(tmp_path / "plan.yml", tried=False) == plan


def test_a_plan_in_memory_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    folder, plan = begun(tmp_path, off_policy("dqn"))
    before = sorted(folder.path.iterdir())
    wrong = dataclasses.replace(plan, env={**plan.env, "action": "continuous"})
    with pytest.raises(InputError, match="training plan, algorithm: expected one of ppo"):
        TrainingRun(folder, wrong)
    assert sorted(folder.path.iterdir()) == before


@pytest.mark.parametrize(("actions", "numbers"), [(Box(-1, 1, (3,)), 3), (Discrete(9), 2)])
def test_a_buffer_takes_the_memory_that_is_said(actions: Any, numbers: int) -> None:
    seen: gymnasium.Space[Any] = Box(-1, 1, (21,), np.float32)
    buffer = ReplayBuffer(60, seen, actions, device="cpu", n_envs=3)
    names = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
    size = sum(getattr(buffer, name).nbytes for name in names)
    assert size == 60 * sample_bytes(21, numbers)


def test_a_buffer_of_half_the_memory_is_allowed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = plan_file(tmp_path / "plan.yml", off_policy("dqn"))
    plan = read_plan(file)
    batch: Any = gymnasium.make_vec(plan.task, **stage_settings(plan, plan.stages[0]))
    half = 100 * sample_bytes(spaces.flatdim(batch.single_observation_space), 2)
    batch.close()
    monkeypatch.setattr(plan_check, "memory_bytes", lambda: 2 * half)
    read_plan(file)
    monkeypatch.setattr(plan_check, "memory_bytes", lambda: 2 * half - 2)
    with pytest.raises(InputError, match=r"expected at most 99 samples of .* found 100$"):
        read_plan(file)


def test_each_field_says_who_uses_it() -> None:
    """In its docstring, from which the printed plan has its comments."""
    meanings = field_docs(OffPolicyPlan)
    assert USERS.keys() == {each.name for each in dataclasses.fields(OffPolicyPlan)}
    for name, users in USERS.items():
        if users != OFF_POLICY:
            assert f"for {' and '.join(f'`{user}`' for user in users)}." in meanings[name]


def test_the_plan_in_the_documents_is_one(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "docs" / "training.md").read_text(encoding="utf-8")
    example = text.split("```yaml\n")[2].split("```")[0]
    (tmp_path / "plan.yml").write_text(example, encoding="utf-8")
    plan = read_plan(tmp_path / "plan.yml", "Albot/Homing-v0")
    assert plan.algorithm == "sac"
    assert plan.off_policy == OffPolicyPlan()  # It shows all fields, with their defaults.
    assert all(f"  {name}: " in example for name in USERS)
