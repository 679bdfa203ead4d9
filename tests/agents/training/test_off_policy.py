"""Learners with a replay buffer: how they explore, what they learn, what a resumed run has."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3.common.vec_env import DummyVecEnv
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from albot_agents.registry import make_agent
from albot_agents.trained.agent_file import read_agent
from albot_agents.training.checkpoint import (
    Checkpoint,
    checkpoints,
    learnt_tensors,
    read_checkpoint,
    take_checkpoint,
)
from albot_agents.training.learner import make_learner
from albot_agents.training.off_policy_plan import OFF_POLICY, VALUE_BASED, OffPolicyPlan
from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_core.errors import InputError
from tests.agents.training.tiny import SAMPLES, begun, off_policy

Trained = tuple[RunFolder, TrainingPlan, TrainingRun, dict[str, Any]]


@pytest.fixture(scope="module", params=OFF_POLICY)
def trained(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Trained:
    """Folder, plan, the run, and what came of it, for each algorithm."""
    folder, plan = begun(tmp_path_factory.mktemp(request.param), off_policy(request.param))
    run = TrainingRun(folder, plan)
    return folder, plan, run, run.run()


def _newest(folder: RunFolder) -> Checkpoint:
    return read_checkpoint(checkpoints(folder.checkpoints)[-1])


def test_its_agent_acts_as_the_learner(trained: Trained) -> None:
    folder, _, run, result = trained
    assert result["samples"] == SAMPLES
    assert folder.best.is_file()
    assert [path.stem for path in checkpoints(folder.checkpoints)] == [f"{128:012d}", f"{160:012d}"]
    with np.load(folder.evaluations) as found:
        assert found["timesteps"].tolist() == [64, 128, 160]
    learner = run.learner
    agent = make_agent(str(folder.last))
    agent.reset(np.random.default_rng(0), learner.action_space)
    assert learner.observation_space.shape is not None
    rows = np.random.default_rng(1).uniform(-1, 1, (20, *learner.observation_space.shape))
    for row in rows.astype(np.float32):
        expected, _ = learner.policy.predict(row, deterministic=True)
        np.testing.assert_allclose(agent.act(row, {}), expected, atol=1e-5)


def test_its_losses_are_logged_once_a_round(trained: Trained) -> None:
    """stable-baselines3 would log every four episodes, of which a step may end hundreds."""
    log = EventAccumulator(str(trained[0].tensorboard)).Reload()
    loss = "train/critic_loss" if trained[1].algorithm == "sac" else "train/loss"
    assert [event.step for event in log.Scalars(loss)] == [64, 128, 160]
    assert {"rollout/ep_rew_mean", "eval/return"} <= set(log.Tags()["scalars"])


def test_a_resumed_run_has_all_but_the_buffer(trained: Trained, tmp_path: Path) -> None:
    folder = RunFolder(Path(shutil.copytree(trained[0].path, tmp_path / "again")))
    saved = _newest(folder)
    names = {
        "sac": {"actor.mu.weight", "critic.qf1.0.weight", "log_ent_coef"},
        "dqn": {"q_net.q_net.0.weight"},
        "qrdqn": {"quantile_net.quantile_net.2.bias"},
    }[trained[1].algorithm]
    assert {f"adam.exp_avg_sq.{name}" for name in names} <= saved.arrays.keys()
    targets = {name for name in saved.weights if "target" in name}
    assert targets
    assert not any("target" in name for name in saved.arrays if name.startswith("adam"))
    run = TrainingRun(folder, folder.resume(None, n_timesteps=SAMPLES + 80))
    restored = take_checkpoint(run.learner, saved.run)
    assert restored.arrays.keys() == saved.arrays.keys()
    assert (restored.samples, restored.updates) == (saved.samples, saved.updates)
    assert restored.updates == (SAMPLES - 20) // 2
    for name, array in saved.arrays.items():
        np.testing.assert_array_equal(restored.arrays[name], array)
    # Learning goes on once there are 20 new samples, more than learning_starts.
    learner: Any = run.learner
    assert learner.replay_buffer.size() == 0
    train, updated = learner.train, []
    learner.train = lambda **settings: (updated.append(learner.num_timesteps), train(**settings))
    assert run.run()["samples"] == SAMPLES + 80
    assert updated == list(range(SAMPLES + 22, SAMPLES + 81, 2))
    for name, tensor in learnt_tensors(learner).items():
        assert not np.array_equal(tensor.detach().numpy(), saved.weights[name]), name
    folder.last.unlink()  # It was killed before it wrote its agent, and has nothing left to learn.
    assert TrainingRun(folder, folder.resume(None)).run()["samples"] == SAMPLES + 80
    assert folder.last.is_file()
    told: list[str] = []
    TrainingRun(folder, folder.resume(None, n_timesteps=SAMPLES + 90), told.append).close()
    assert "nothing more is learnt before" in told[0]


def test_the_same_seed_gives_the_same_agent(tmp_path_factory: pytest.TempPathFactory) -> None:
    agents = []
    for name in ("one", "other"):
        folder, plan = begun(tmp_path_factory.mktemp(name), off_policy("sac"), evaluation=None)
        TrainingRun(folder, plan).run()
        agents.append(read_agent(folder.last).fingerprint)
    assert agents[0] == agents[1]


def test_ctrl_c_saves_the_last_round(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changes = {"checkpoint_every": 1000, "evaluation": None}
    folder, plan = begun(tmp_path, off_policy("dqn"), **changes)
    run = TrainingRun(folder, plan)
    train: Any = run.learner.train

    def interrupted(**settings: int) -> None:
        if run.learner.num_timesteps == 90:
            raise KeyboardInterrupt
        train(**settings)

    monkeypatch.setattr(run.learner, "train", interrupted)
    result = run.run()
    assert (result["stopped"], result["samples"]) == (True, 64)
    assert [path.stem for path in checkpoints(folder.checkpoints)] == [f"{64:012d}"]


def test_a_stage_goes_on_with_the_buffer(tmp_path: Path) -> None:
    stages = [{"for_steps": 64}, {"env": {"max_episode_steps": 2}}]
    folder, plan = begun(tmp_path, off_policy("dqn"), curriculum=stages, evaluation=None)
    run = TrainingRun(folder, plan)
    assert run.run()["stage"] == 1
    lines = folder.monitor.read_text().splitlines()[2:]
    assert [int(line.split(",")[1]) for line in lines[-40:]] == [2] * 40
    learner: Any = run.learner
    assert learner.replay_buffer.size() * 2 == 100


def test_a_coefficient_that_diverges_is_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, plan = begun(tmp_path, off_policy("sac"))
    run = TrainingRun(folder, plan)
    learner: Any = run.learner
    train = learner.train

    def diverge(**settings: int) -> None:
        train(**settings)
        if learner.num_timesteps == 100:
            with torch.no_grad():
                learner.log_ent_coef.fill_(21.0)

    monkeypatch.setattr(learner, "train", diverge)
    with pytest.raises(InputError, match=r"within ±20; .* in log_ent_coef .*64\.checkpoint is int"):
        run.run()


class _Nearest(gymnasium.Env[np.ndarray, Any]):
    """One step: the first number of the observation is to be said, as a number or as its third."""

    observation_space = Box(-1, 1, (2,), np.float32)

    def __init__(self, discrete: bool) -> None:
        self.action_space: Any = Discrete(3) if discrete else Box(-1, 1, (1,), np.float32)

    def reset(self, **options: Any) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(**options)
        return self._draw(), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        said = action[0] if isinstance(self.action_space, Box) else (int(action) - 1) / 1.5
        reward = -abs(float(said) - self._right)
        return self._draw(), reward, True, False, {}

    def _draw(self) -> np.ndarray:
        row = self.np_random.uniform(-0.9, 0.9, 2).astype(np.float32)
        self._right = float(row[0])
        return row


def _learner(algorithm: str, n_envs: int, **changes: Any) -> Any:
    """A learner for the task above."""
    plan = TrainingPlan(
        **{
            "algorithm": algorithm,
            "n_envs": n_envs,
            "batch_size": 64,
            "gamma": 0.0,
            "learning_rate": 0.005,
            "n_timesteps": 2000,
            "policy": PolicyPlan(net_arch=(32,), activation="relu"),
            "off_policy": OffPolicyPlan(
                learning_starts=200,
                buffer_size=5000,
                gradient_steps=1,
                **({"target_update_interval": 100} if algorithm in VALUE_BASED else {}),
            ),
        }
        | changes
    )
    envs = DummyVecEnv([lambda: _Nearest(algorithm in VALUE_BASED)] * n_envs)
    return make_learner(plan, envs)


@pytest.mark.parametrize("algorithm", OFF_POLICY)
def test_it_learns_a_task_whose_answer_is_known(algorithm: str) -> None:
    learner = _learner(algorithm, 16)
    learner.learn(2000, log_interval=None)
    rows = np.random.default_rng(5).uniform(-0.9, 0.9, (200, 2)).astype(np.float32)
    answers, _ = learner.policy.predict(rows, deterministic=True)
    if algorithm == "sac":
        assert np.abs(answers[:, 0] - rows[:, 0]).mean() < 0.1
    else:
        right = np.abs(rows[:, :1] - [[-2 / 3, 0, 2 / 3]]).argmin(axis=1)
        assert (answers == right).mean() > 0.9


@pytest.mark.parametrize("algorithm", VALUE_BASED)
def test_each_environment_explores_for_itself(algorithm: str) -> None:
    own = OffPolicyPlan(
        learning_starts=1000,
        exploration_fraction=0.5,
        exploration_initial_eps=0.8,
        exploration_final_eps=0.2,
    )
    policy = PolicyPlan(net_arch=(4,), initial_action=(1.0, 0.0, float(np.log(2))))
    count = 3000
    learner = _learner(algorithm, count, off_policy=own, policy=policy, n_timesteps=100_000)
    learner._total_timesteps = 100_000
    learner._last_obs = np.zeros((count, 2), np.float32)
    best = int(learner.policy.predict(learner._last_obs[:1], deterministic=True)[0][0])
    chances = np.array([np.e, 1, 2]) / (np.e + 3)
    # At random at first; then by a chance that falls for half of the training.
    for samples, random in ((0, 1.0), (999, 1.0), (25_000, 0.5), (90_000, 0.2)):
        learner.num_timesteps = samples
        actions, stored = learner._sample_action(0, None, count)
        np.testing.assert_array_equal(actions, stored)
        expected = random * chances + (1 - random) * (np.arange(3) == best)
        np.testing.assert_allclose(np.bincount(actions, minlength=3) / count, expected, atol=0.04)


def test_sac_begins_with_the_action_of_its_plan() -> None:
    """From the first step on: one in four uniform actions would declare home."""
    policy = PolicyPlan(net_arch=(4,), initial_action=(-0.9,), log_std_init=-3.0)
    count = 500
    learner = _learner("sac", count, policy=policy, off_policy=OffPolicyPlan(learning_starts=1500))
    with torch.no_grad():  # What depends on the observation.
        learner.actor.mu.weight.zero_()
        learner.actor.log_std.weight.zero_()
    learner._last_obs = np.zeros((count, 2), np.float32)
    actions, _ = learner._sample_action(1500, None, count)
    before = np.arctanh(actions.astype(np.float64))
    assert before.mean() == pytest.approx(np.arctanh(-0.9), abs=0.02)
    assert before.std() == pytest.approx(np.exp(-3), rel=0.15)


def test_targets_follow_in_the_same_steps_after_a_stop(tmp_path: Path) -> None:
    """A hard update every 20 samples: ten steps of two environments, also after 130 samples."""
    changes = {"target_update_interval": 20, "learning_starts": 150}
    plan_changes = {"n_timesteps": 152, "off_policy": changes, "evaluation": None}
    folder, plan = begun(tmp_path, off_policy("dqn"), **plan_changes)
    TrainingRun(folder, plan).run()
    run = TrainingRun(folder, folder.resume(None, n_timesteps=162))
    learner: Any = run.learner
    with torch.no_grad():
        learner.q_net.q_net[0].bias.fill_(7.0)
    followed: list[int] = []
    act = learner._on_step

    def on_step() -> None:
        act()
        if not followed and bool((learner.q_net_target.q_net[0].bias == 7.0).all()):
            followed.append(learner.num_timesteps)

    learner._on_step = on_step
    run.run()
    assert followed == [160]


def test_the_plan_reaches_the_learner() -> None:
    own = OffPolicyPlan(
        buffer_size=4000, learning_starts=77, train_freq=3, gradient_steps=5, tau=0.3,
        ent_coef="auto_0.4", target_entropy=-2.5,
    )  # fmt: skip
    numbers = {"batch_size": 48, "gamma": 0.91, "seed": 17, "learning_rate": "lin_0.008_0.004"}
    policy = PolicyPlan(net_arch=(5, 7), value_arch=(11,), activation="elu")
    learner = _learner("sac", 2, off_policy=own, policy=policy, **numbers)
    names = ("buffer_size", "learning_starts", "gradient_steps", "tau", "target_entropy")
    assert [getattr(learner, name) for name in names] == [getattr(own, name) for name in names]
    assert [getattr(learner, name) for name in ("batch_size", "gamma", "seed")] == [48, 0.91, 17]
    assert learner.train_freq.frequency == 3
    assert learner.lr_schedule(0.25) == pytest.approx(0.005)
    assert learner.replay_buffer.buffer_size * 2 == 4000
    assert learner.log_ent_coef.item() == pytest.approx(np.log(0.4))
    assert _sizes(learner.actor.latent_pi) == [5, 7]
    assert _sizes(learner.critic.qf1) == [11, 1]
    assert torch.nn.ELU in {type(layer) for layer in learner.critic.qf0}

    own = OffPolicyPlan(
        target_update_interval=640, exploration_fraction=0.4, exploration_initial_eps=0.9,
        exploration_final_eps=0.1, n_quantiles=6, learning_starts=77,
    )  # fmt: skip
    policy = PolicyPlan(net_arch=(5, 7))
    learner = _learner("qrdqn", 2, off_policy=own, policy=policy, max_grad_norm=0.7)
    assert (learner.target_update_interval, learner.max_grad_norm, learner.tau) == (640, 0.7, 1)
    assert [learner.exploration_schedule(left) for left in (1, 0.8, 0.5)] == pytest.approx(
        [0.9, 0.5, 0.1]
    )
    assert _sizes(learner.quantile_net.quantile_net) == [5, 7, 18]
    # No warning of stable-baselines3 where a step of all environments is more than the interval.
    own = OffPolicyPlan(target_update_interval=1, learning_starts=77)
    assert _learner("dqn", 64, off_policy=own).target_update_interval == 64


def _sizes(network: torch.nn.Module) -> list[int]:
    return [layer.out_features for layer in network.modules() if isinstance(layer, torch.nn.Linear)]
