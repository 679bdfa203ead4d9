"""Batches for stable-baselines3 that are timed, or without cost. Needs the extra `train`."""

from __future__ import annotations

import time

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn


class TimedBatch(VecEnvWrapper):
    """Measures the time spent in the steps of a batch.

    Args:
        batch: The batch.
    """

    def __init__(self, batch: VecEnv) -> None:
        super().__init__(batch)
        self.seconds = 0.0
        """Time spent in steps so far (s)."""

    def reset(self) -> VecEnvObs:
        """Reset the batch; this is not timed."""
        return self.venv.reset()

    def step_async(self, actions: np.ndarray) -> None:
        """Begin a step."""
        began = time.perf_counter()
        self.venv.step_async(actions)
        self.seconds += time.perf_counter() - began

    def step_wait(self) -> VecEnvStepReturn:
        """End the step."""
        began = time.perf_counter()
        result = self.venv.step_wait()
        self.seconds += time.perf_counter() - began
        return result


class FreeBatch(VecEnvWrapper):
    """Returns the observations of the batch's reset at every step, and never ends.

    Args:
        batch: The batch with the same spaces.
    """

    def reset(self) -> VecEnvObs:
        """Reset the batch, and keep its observations."""
        self._observations = self.venv.reset()
        self._rewards = np.zeros(self.num_envs, np.float32)
        self._over = np.zeros(self.num_envs, np.bool_)
        return self._observations

    def step_async(self, actions: np.ndarray) -> None:
        """Do nothing."""

    def step_wait(self) -> VecEnvStepReturn:
        """Return the same result as always."""
        return self._observations, self._rewards, self._over, [{} for _ in range(self.num_envs)]
