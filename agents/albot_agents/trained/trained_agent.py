"""Run a trained agent in an environment, and find the trained agents of the project."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import fields
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from jaxtyping import Float32

from albot_agents.agent import Action, EnvironmentConfigs
from albot_agents.trained.agent_file import SUFFIX, AgentFile
from albot_agents.trained.network import CANDIDATES, Network
from albot_core.errors import InputError
from albot_core.plain_data import differences, to_plain
from albot_env.tasks.core.actions import ActionConfig

_FOLDER = Path(str(resources.files("albot_agents.trained")))
"""Folder of the trained agents that come with the project."""


class TrainedAgent:
    """Acts by its network: the mean action, the most probable one, or one drawn around the mean.

    Args:
        name: Its name, or the path of its file.
        file: The content of its file.
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: They differ from those in training; the message says in what.
    """

    knows_truth: ClassVar[bool] = False

    def __init__(self, name: str, file: AgentFile, configs: EnvironmentConfigs) -> None:
        self.name = name
        self._file = file
        self._observation_config = configs.observations
        self._network = Network(file.network, file.weights)
        self._rng = np.random.default_rng(0)  # Until the first reset.
        trained = file.observation_config
        if trained is None:
            return  # Its task has one form of observations, and answers for actions.
        for what, its, learnt in (
            ("observations", configs.observations, trained),
            ("actions", _scales_of(configs.actions), _scales_of(file.actions)),
        ):
            differing = differences(to_plain(its), to_plain(learnt))
            if differing:
                raise InputError(name, f"{what} as in its training", "; ".join(differing))

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode.

        Raises:
            InputError: The environment's observations or actions do not fit the network.
        """
        self._check_observations()
        outputs = self._file.network.outputs
        mine = f"{outputs} discrete" if self._file.discrete else f"{outputs} numbers"
        if isinstance(actions, Discrete):
            theirs = f"{actions.n} discrete"
        else:
            theirs = f"{actions.shape[0]} numbers" if isinstance(actions, Box) else str(actions)
        if mine != theirs:
            raise InputError(self.name, f"actions as in its training: {mine}", theirs)
        self._network.reset()
        self._rng = rng

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the mean action, the most probable discrete action, or a sampled action.

        Raises:
            InputError: The observation has other parts or another shape than the environment's, or
                is not finite.
        """
        answer = self._network(self._flat(observation))
        if self._file.discrete:
            return np.int64(np.argmax(answer))
        if self._file.network.sampled:
            answer = self._network.sample(answer, self._rng)
        return np.asarray(np.clip(answer, -1, 1))

    def _flat(self, observation: Any) -> Float32[np.ndarray, "inputs"]:
        """Return an observation as the network's inputs."""
        if isinstance(observation, dict):
            shapes = self._observation_config.shapes
            try:
                found = {
                    part: np.shape(observation[part]) for part in shapes if part in observation
                }
            except ValueError:  # Lists of unequal length.
                raise InputError(
                    self.name, f"observations with {_told(shapes)}", reprlib.repr(observation)
                ) from None
            if found != shapes:
                raise InputError(self.name, f"observations with {_told(shapes)}", _told(found))
            observation = np.concatenate([np.ravel(observation[part]) for part in shapes])
        inputs = self._file.network.inputs
        expected = f"observations of {inputs} finite numbers"
        try:
            row = np.asarray(observation, np.float32)
        except (TypeError, ValueError):
            raise InputError(self.name, expected, reprlib.repr(observation)) from None
        if row.shape != (inputs,):
            raise InputError(self.name, expected, f"the shape {row.shape}")
        if not np.isfinite(row).all():
            raise InputError(self.name, expected, "NaN or infinity")
        return row

    def _check_observations(self) -> None:
        """Raise InputError if the observations do not fit the network."""
        network = self._file.network
        if network.candidates:
            self._observation_config.require(CANDIDATES, self.name)
        (length,) = self._observation_config.flat_space.shape
        if length != network.inputs:
            expected = f"observations of {network.inputs} numbers"
            raise InputError(self.name, expected, f"{length}")


def _scales_of(actions: ActionConfig) -> dict[str, float]:
    """The scales of actions by name; a threshold matters to the environment alone."""
    return {scale.name: getattr(actions, scale.name) for scale in fields(ActionConfig)}


def _told(shapes: Mapping[str, tuple[int, ...]]) -> str:
    return ", ".join(f"{part} {shape}" for part, shape in shapes.items()) or "none of them"


def shipped_agents() -> dict[str, Path]:
    """Return the files of the project's trained agents by name, in alphabetical order."""
    files = {path.stem: path for path in _FOLDER.glob(f"*{SUFFIX}")}
    return dict(sorted(files.items()))


def card_path(name: str) -> Path:
    """Return the path of a shipped agent's model card."""
    return _FOLDER / f"{name}.md"
