"""Batched environments for stable-baselines3, which does not accept gymnasium vector environments.

Needs the extra `train`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from albot_core.errors import InputError
from albot_env.vector import TRAINING_EXTRA

try:
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor
    from stable_baselines3.common.vec_env.base_vec_env import (
        VecEnvIndices,
        VecEnvObs,
        VecEnvStepReturn,
    )
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"{error}; {TRAINING_EXTRA}", name=error.name) from None

_SOURCE = "stable-baselines3"


def make_sb3(environment: str, num_envs: int, **settings: Any) -> VecMonitor:
    """Make many environments in one, for stable-baselines3's learners.

    They are monitored: a learner reports the mean returns and lengths of its episodes
    (`ep_rew_mean`, `ep_len_mean`). To also write a file of the episodes, wrap `make_batch` in a
    `VecMonitor` with a file name.

    Args:
        environment: Id, such as `Albot/Explore-v0`.
        num_envs: Number of environments.
        settings: As for `gymnasium.make_vec`.

    Raises:
        InputError: As for the environment.
    """
    return VecMonitor(make_batch(environment, num_envs, **settings))


def make_batch(environment: str, num_envs: int, **settings: Any) -> BatchedVecEnv:
    """Make the environments of `make_sb3` without a monitor."""
    settings = {"autoreset_mode": AutoresetMode.SAME_STEP, **settings}
    return BatchedVecEnv(gymnasium.make_vec(environment, num_envs=num_envs, **settings))


class BatchedVecEnv(VecEnv):
    """Adapter from a batch of environments to stable-baselines3's `VecEnv`.

    The attributes and methods of its environments are those of `BatchMember`: with `action_masks`
    sb3-contrib's MaskablePPO learns place recognition, with images a VecVideoRecorder films.

    Most steps have empty infos. The info of an episode's last step holds `terminal_observation`,
    `TimeLimit.truncated`, the numbers and names of the final info and, if the task has a success
    criterion, `is_success`.

    Args:
        batch: The batch; its autoreset mode must be `SameStep`, as stable-baselines3 expects.

    Raises:
        InputError: The batch has another autoreset mode.
    """

    def __init__(self, batch: VectorEnv[Any, Any, np.ndarray]) -> None:
        mode = batch.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            raise InputError(_SOURCE, "autoreset_mode SameStep", str(mode))
        self.batch: Any = batch
        """The batch."""
        self._actions: np.ndarray | None = None
        super().__init__(batch.num_envs, batch.single_observation_space, batch.single_action_space)
        self.metadata = batch.metadata
        """The batch's metadata; VecVideoRecorder finds the frames per second in it."""

    def reset(self) -> VecEnvObs:
        """Reset all environments, with the seeds of `seed` and the options of `set_options`.

        Raises:
            InputError: The options differ between environments.
        """
        given, seeds = self._options, list(self._seeds)
        # They apply to one reset, even if it fails.
        self._reset_seeds()
        self._reset_options()
        if any(options != given[0] for options in given):
            raise InputError(_SOURCE, "the same options for all", str(given))
        observations: VecEnvObs
        observations, infos = self.batch.reset(seed=seeds, options=given[0])
        self.reset_infos = [_single(infos, k) for k in range(self.num_envs)]
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Take the step."""
        assert self._actions is not None, "step_async comes before step_wait"
        observations, rewards, ended, truncated, batched = self.batch.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        over = ended | truncated
        for k in np.flatnonzero(over).tolist():
            infos[k] = _single(batched["final_info"], k)
            infos[k]["terminal_observation"] = batched["final_obs"][k]
            infos[k]["TimeLimit.truncated"] = bool(truncated[k] and not ended[k])
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the batch."""
        self.batch.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return the present moments as images; `render` makes one of them."""
        images = self.batch.render()
        return [None] * self.num_envs if images is None else list(images)

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each selected environment.

        Raises:
            AttributeError: The environments of a batch have no such attribute.
        """
        return [getattr(member, attr_name) for member in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of each selected environment to the same value.

        Raises:
            AttributeError: It cannot be set in the environments of a batch.
            InputError: The value is of another kind.
        """
        for member in self._chosen(indices):
            member.set_attribute(attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of each selected environment; return the results.

        Raises:
            AttributeError: The environments of a batch have no such method.
        """
        return [method(*method_args, **kwargs) for method in self.get_attr(method_name, indices)]

    def env_is_wrapped(
        self,
        wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]],
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Return False for all: the environments of a batch are not wrapped."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: VecEnvIndices) -> list[Any]:
        """Return the selected environments, each a `BatchMember`."""
        members = self.batch.unwrapped.members
        return [members[index] for index in self._get_indices(indices)]


def _single(batched: dict[str, Any], index: int) -> dict[str, Any]:
    """Return the info of one environment out of a batch's."""
    return {
        key: _single(value, index) if isinstance(value, dict) else value[index]
        for key, value in batched.items()
        if not key.startswith("_")
    }
