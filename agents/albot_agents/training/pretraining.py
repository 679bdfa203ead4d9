"""Pretraining: a learner's policy clones an agent before reinforcement learning begins.

With more than one round this is DAgger (Ross, Gordon and Bagnell, A reduction of imitation learning
and structured prediction to no-regret online learning, AISTATS 2011, algorithm 3.1). In the first
round the agent drives, which is behaviour cloning. Later the policy drives more and more of the
environments, so that it also sees the states that its own mistakes lead to; the agent says at each
step what it would do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from jaxtyping import Bool, UInt8
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from albot_agents.training.cloning import Cloner
from albot_agents.training.demonstrations import (
    CUT,
    FAILED,
    GOES_ON,
    SUCCEEDED,
    Demonstrations,
    Lesson,
    read_demonstrations,
)
from albot_agents.training.journeys import prepare_journeys
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import first_world, pretraining_settings
from albot_agents.training.teachers import TaughtEnvironments

_STREAM = 1
"""Number of the random stream of pretraining; the training's own has none."""
_REPORT_EVERY = 16
"""Steps between two reports."""

Report = Callable[[str], None]
Samples = Bool[np.ndarray, "robots"]


class Pretraining:
    """Pretrains a learner's policy.

    The same plan gives the same policy, also if it was killed and begins again: what a round draws
    depends on the plan's seed and the number of the round, and demonstrations of rounds that were
    saved are not made again.

    Args:
        plan: The plan of the training, with `pretrain`.
        learner: The learner, untrained.
        path: The file for the demonstrations.
        warn: Called if no episode is shown to its end, so that its end cannot be learnt.
    """

    def __init__(
        self,
        plan: TrainingPlan,
        learner: OnPolicyAlgorithm,
        path: Path,
        warn: Report = lambda text: None,
    ) -> None:
        assert plan.pretrain is not None
        self._plan, self._pretrain, self._learner, self._path = plan, plan.pretrain, learner, path
        self._settings = pretraining_settings(plan)
        self._warn = warn

    def run(self, report: Report = lambda note: None) -> dict[str, float | int | None]:
        """Pretrain; return `samples`, the agent's `success_rate` and the last epoch's figures.

        The success rate is that of the agent alone, None if no episode ended; the others are those
        of `Cloner.learn`.

        Args:
            report: Called with the progress as text.

        Raises:
            InputError: Saved demonstrations are damaged or do not fit; or they cannot be saved.
        """
        figures = (
            self._clone_file(Path(self._pretrain.demonstrations), report)
            if self._pretrain.demonstrations
            else self._clone_agent(report)
        )
        # What follows must not depend on whether the last demonstrations were made or read.
        torch.manual_seed(_number(self._entropy(self._pretrain.rounds)))
        spread = getattr(self._learner.policy, "log_std", None)
        if self._pretrain.log_std is not None and spread is not None:
            with torch.no_grad():
                spread.fill_(self._pretrain.log_std)
        return figures

    def _clone_file(self, path: Path, report: Report) -> dict[str, float | int | None]:
        settings = first_world(self._settings)
        batch: Any = gymnasium.make_vec(self._plan.task, num_envs=1, **settings).unwrapped
        batch.close()
        demonstrations = self._read(path, batch)
        return self._clone(self._cloner(batch), demonstrations, 0, report)

    def _clone_agent(self, report: Report) -> dict[str, float | int | None]:
        plan, pretrain = self._plan, self._pretrain
        envs = TaughtEnvironments(plan.task, pretrain.agent, pretrain.n_envs, self._settings)
        try:
            saved = self._read(self._path, envs.batch) if self._path.exists() else None
            cloner, figures = self._cloner(envs.batch), {}
            for k in range(pretrain.rounds):
                if saved is None or saved.rounds <= k:
                    prepare_journeys(plan.task, envs.batch, self._settings, report)
                    made = self._demonstrate(envs, k, report)
                    saved = made if saved is None else saved.joined(made)
                    saved.save(self._path)
                figures = self._clone(cloner, saved.first(k + 1), k, report)
        finally:
            envs.close()
        return figures

    def _demonstrate(self, envs: TaughtEnvironments, k: int, report: Report) -> Demonstrations:
        """Return the demonstrations of round k."""
        plan, pretrain = self._plan, self._pretrain
        count, steps = pretrain.n_envs, pretrain.steps_per_round
        entropy = self._entropy(k)
        torch.manual_seed(_number(entropy))
        # In the paper the agent drives at each step with this probability. Here it drives this
        # share of the environments, so that what it demonstrates there is whole.
        taught = np.arange(count) < round(count * pretrain.beta**k)
        observations = envs.reset(_number(entropy))
        state, begins = None, np.ones(count, np.bool_)
        columns: list[tuple[Any, ...]] = []
        for step in range(steps):
            if step % _REPORT_EVERY == 0:
                note = f"{step * count:,} of {steps * count:,} samples demonstrated"
                report(f"{self._round(k)}{note}")
            wanted = actions = envs.demonstrate()
            if not taught.all():
                actions, state = self._learner.policy.predict(observations, state, begins)
                actions[taught] = wanted[taught]
            before = observations.astype(np.float16)
            observations, rewards, ended, truncated, infos = envs.step(actions)
            after = _after(ended, truncated, infos)
            columns.append((before, wanted, rewards.astype(np.float32), begins, after))
            begins = ended | truncated
        after[after == GOES_ON] = CUT
        names = "observations", "actions", "rewards", "begins", "after"
        rows = (np.stack(each, axis=1) for each in zip(*columns, strict=True))
        return Demonstrations(
            lesson=self._lesson(envs.batch),
            agent=pretrain.agent,
            seed=plan.seed,
            rounds=1,
            **dict(zip(names, rows, strict=True)),
        )

    def _clone(
        self, cloner: Cloner, demonstrations: Demonstrations, k: int, report: Report
    ) -> dict[str, float | int | None]:
        """Let the policy learn from the demonstrations of all rounds up to round k."""
        if k == 0 and not demonstrations.shows_an_end:
            steps = demonstrations.rewards.shape[1]
            self._warn(
                f"pretrain: no episode ended within the {steps:,} steps of a round; fewer n_envs, "
                "or more steps, show the ends of episodes"
            )
        rng = np.random.default_rng(self._entropy(k))
        figures = cloner.learn(demonstrations, rng, lambda note: report(f"{self._round(k)}{note}"))
        told = {"samples": demonstrations.count, "success_rate": demonstrations.success_rate}
        return told | figures

    def _cloner(self, batch: Any) -> Cloner:
        return Cloner(self._learner.policy, self._pretrain, self._plan.gamma, batch.action_config)

    def _read(self, path: Path, batch: Any) -> Demonstrations:
        return read_demonstrations(
            path, self._lesson(batch), batch.single_observation_space.shape[0]
        )

    def _lesson(self, batch: Any) -> Lesson:
        return Lesson.of(self._plan.task, self._settings, batch)

    def _entropy(self, k: int) -> np.random.SeedSequence:
        return np.random.SeedSequence((self._plan.seed, _STREAM, k))

    def _round(self, k: int) -> str:
        """Return the beginning of a report of round k."""
        rounds = self._pretrain.rounds
        return f"round {k + 1} of {rounds}, " if rounds > 1 else ""


def _number(entropy: np.random.SeedSequence) -> int:
    return int(entropy.generate_state(1)[0])


def _after(
    ended: Samples, truncated: Samples, infos: Mapping[str, Any]
) -> UInt8[np.ndarray, "robots"]:
    """Return what came after a step in each environment."""
    after = np.where(truncated, CUT, GOES_ON)
    succeeded = np.zeros(len(ended), np.bool_)
    if (ended | truncated).any():
        succeeded = np.asarray(infos["final_info"].get("is_success", succeeded), np.bool_)
    after[ended] = FAILED
    after[ended & succeeded] = SUCCEEDED
    return after.astype(np.uint8)
