"""One environment of a batch, as `call`, `get_attr` and `set_attr` of a batch see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Space
from jaxtyping import UInt8

from albot_core.errors import InputError, did_you_mean
from albot_core.robot import RobotConfig
from albot_env.recording.episode import Recorder
from albot_env.tasks.core.episode_state import EpisodeState
from albot_env.tasks.core.observation import ObservationConfig

if TYPE_CHECKING:
    from albot_env.tasks.core.vector import VectorEnv


class BatchMember:
    """The attributes and methods that each environment of a batch has as its own.

    Args:
        batch: The batch.
        index: Number of the environment.
    """

    SETTABLE = ("agent", "np_random", "recorder")
    """The attributes that can be set."""

    def __init__(self, batch: VectorEnv[Any], index: int) -> None:
        self._batch = batch
        self._index = index

    @property
    def unwrapped(self) -> BatchMember:
        """The same: a batch does not wrap its environments."""
        return self

    @property
    def spec(self) -> EnvSpec | None:
        """The spec of the batch."""
        return self._batch.spec

    @property
    def metadata(self) -> dict[str, Any]:
        """The metadata of the batch."""
        return self._batch.metadata

    @property
    def render_mode(self) -> str | None:
        """The render mode of the batch."""
        return self._batch.render_mode

    @property
    def action_space(self) -> Space[Any]:
        """The space of its actions."""
        return self._batch.single_action_space

    @property
    def observation_space(self) -> Space[Any]:
        """The space of its observations."""
        return self._batch.single_observation_space

    @property
    def observation_config(self) -> ObservationConfig:
        """How its observations are made of readings, with the sensors chosen."""
        config: ObservationConfig = self._batch.observation_config
        return config

    @property
    def robot_config(self) -> RobotConfig:
        """Body and drive of its robot."""
        return self._batch.robot_config

    @property
    def np_random(self) -> np.random.Generator:
        """The generator that draws its episodes.

        Raises:
            ResetNeeded: There was no reset before.
        """
        return self._batch._generator(self._index)

    @np_random.setter
    def np_random(self, generator: Any) -> None:
        if not isinstance(generator, np.random.Generator):
            found, environment = repr(generator)[:80], self._batch.task.environment
            raise InputError(environment, "a numpy Generator", found, place="np_random")
        self._batch._generators[self._index] = generator

    @property
    def recorder(self) -> Recorder:
        """Records its episodes from the next reset on (see `SingleEnv.recorder`).

        A batch begins another episode when one is over: see `FirstEpisode`.
        """
        return self._batch._followers.of(self._index).recorder

    @recorder.setter
    def recorder(self, recorder: Any) -> None:
        if not isinstance(recorder, Recorder):
            found, environment = repr(recorder)[:80], self._batch.task.environment
            raise InputError(environment, "a Recorder", found, place="recorder")
        self._batch._followers.of(self._index).recorder = recorder

    @property
    def agent(self) -> str:
        """Name of the agent that acts, for recordings and pictures from the next reset on."""
        return self._batch._followers.of(self._index).agent

    @agent.setter
    def agent(self, agent: str) -> None:
        self._batch._followers.of(self._index).agent = agent

    def set_attribute(self, name: str, value: Any) -> None:
        """Set one of `SETTABLE`.

        Raises:
            AttributeError: There is no such attribute, or it cannot be set.
            InputError: The value is of another kind.
        """
        if name not in self.SETTABLE:
            settable = ", ".join(self.SETTABLE)
            message = f"{name!r} cannot be set in the environments of a batch, only {settable}"
            raise AttributeError(message)
        setattr(self, name, value)

    def get_state(self) -> EpisodeState:
        """Return the state of its episode (see `VectorEnv.get_state`)."""
        return self._batch.get_state(self._index)

    def set_state(self, state: EpisodeState) -> tuple[Any, dict[str, Any]]:
        """Continue the episode that a state is from (see `VectorEnv.set_state`)."""
        return self._batch.set_state(self._index, state)

    def render(self) -> UInt8[np.ndarray, "h w 3"] | None:
        """Return its present moment as an image in `rgb_array` mode; None without a mode."""
        return self._batch._render_one(self._index)

    def __getattr__(self, name: str) -> Any:
        batch: Any = self._batch
        if name == "action_masks" and hasattr(batch, name):
            return lambda: batch.action_masks()[self._index]
        known = [each for each in dir(type(self)) if not each.startswith("_")]
        raise AttributeError(
            f"the environments of a batch have no attribute {name!r}{did_you_mean(name, known)}"
        )
