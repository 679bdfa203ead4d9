"""The environments of a training run: one batch that goes through the stages of a curriculum."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from albot_agents.training.journeys import MadeJourneys, prepare_journeys
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_check import MEMORY, check_spaces
from albot_agents.training.plan_file import stage_settings
from albot_agents.training.recent_episodes import RECENT, EndedEpisode, RecentEpisodes
from albot_agents.training.run_files import FIGURES, Row
from albot_core.errors import InputError
from albot_env.vector.sb3 import BatchedVecEnv, make_batch


class Curriculum(VecEnvWrapper):
    """A batch of environments that records its episodes and moves from stage to stage.

    A stage's environments are made when it begins, with the settings of plan and stage.

    Args:
        plan: The plan.
        stage: Number of the first stage, from 0.
        elapsed: Duration of the training so far (s).

    Raises:
        InputError: An environment cannot be made.
    """

    def __init__(self, plan: TrainingPlan, stage: int, elapsed: float = 0.0) -> None:
        if not 0 <= stage < len(plan.stages):
            raise InputError("stage", f"one below {len(plan.stages)}", str(stage))
        self._plan = plan
        self._start_time = time.monotonic() - elapsed
        self._rows: list[Row] = []
        self._returns = np.zeros(plan.n_envs)
        self._lengths = np.zeros(plan.n_envs, np.int64)
        self._recent = RecentEpisodes(plan.n_envs)
        # `until_success` goes by the episodes that ended last, early endings first. The unbiased
        # rate would switch at other samples, and the plans of shipped agents make other agents.
        self._ended_last: deque[bool] = deque(maxlen=RECENT)
        self.episodes = 0
        """Number of episodes that ended since the training was started or resumed."""
        self.stage = stage
        """Number of the current stage, from 0."""
        self.step_seconds = 0.0
        """Time spent stepping the environments (s)."""
        self.venv: BatchedVecEnv
        super().__init__(self._make_batch(stage))

    @property
    def elapsed(self) -> float:
        """Duration of the training (s), including the time before it was resumed."""
        return time.monotonic() - self._start_time

    @property
    def success_rate(self) -> float | None:
        """Success rate as of `RecentEpisodes`, since all environments last began anew."""
        return self._recent.success_rate

    @property
    def mean_return(self) -> float | None:
        """Mean return as of `RecentEpisodes`, since all environments last began anew."""
        return self._recent.mean_return

    def is_over(self, samples: int) -> bool:
        """Return whether the stage is over after `samples` samples of its own."""
        stage = self._plan.stages[self.stage]
        if self.stage == len(self._plan.stages) - 1:
            return False
        if stage.for_steps is not None and samples >= stage.for_steps:
            return True
        if stage.until_success is None or len(self._ended_last) < RECENT:
            return False
        return float(np.mean(self._ended_last)) >= stage.until_success

    def prepare_journeys(
        self, report: Callable[[str], None], made: MadeJourneys | None = None
    ) -> None:
        """Make this stage's journeys in parallel, before the reset would make them one by one.

        Args:
            report: Called with the progress as text.
            made: As of `prepare_journeys`.
        """
        prepare_journeys(self._plan.task, self.venv.batch, self._settings, report, made)

    def next_stage(self, seed: int, report: Callable[[str], None]) -> VecEnvObs:
        """Begin the next stage; return its first observations.

        Args:
            seed: Seed of the stage's environments.
            report: Called with the progress of making journeys, as text.

        Raises:
            InputError: An environment cannot be made, or its spaces differ from the last stage's.
        """
        following = self._make_batch(self.stage + 1)
        place = MEMORY.at("curriculum", self.stage + 1)
        check_spaces(self.venv.batch, following.batch, place)
        self.venv.close()
        self.venv = following
        self.stage += 1
        self._ended_last.clear()
        self.prepare_journeys(report)
        self.seed(seed)
        return self.reset()

    def reset(self) -> VecEnvObs:
        """Reset all environments."""
        self._returns[:] = 0
        self._lengths[:] = 0
        self._recent = RecentEpisodes(self._plan.n_envs)
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """Take the step. An episode's last info holds `episode`, as with a `Monitor`."""
        began = time.perf_counter()
        observations, rewards, over, infos = self.venv.step_wait()
        self.step_seconds += time.perf_counter() - began
        self._returns += rewards
        self._lengths += 1
        self._recent.step([self._record(k, infos[k]) for k in np.flatnonzero(over).tolist()])
        self._returns[over] = 0
        self._lengths[over] = 0
        return observations, rewards, over, infos

    def take_rows(self) -> list[Row]:
        """Return and clear the log rows of the episodes that ended since the last call."""
        rows, self._rows = self._rows, []
        return rows

    def _record(self, row: int, info: dict[str, Any]) -> EndedEpisode:
        """Record an episode that has ended; return it."""
        episode = {"r": float(self._returns[row]), "l": int(self._lengths[row]), "t": self.elapsed}
        info["episode"] = episode
        self.episodes += 1
        figures = (float(info[name]) if name in info else None for name in FIGURES)
        self._rows.append((*episode.values(), *figures))
        is_success = bool(info["is_success"]) if "is_success" in info else None
        if is_success is not None:
            self._ended_last.append(is_success)
        return EndedEpisode(row, episode["r"], is_success)

    def _make_batch(self, stage: int) -> BatchedVecEnv:
        self._settings = stage_settings(self._plan, self._plan.stages[stage])
        return make_batch(self._plan.task, self._plan.n_envs, **self._settings)
