"""What scripted agents that drive have in common: from observations to senses, and to actions."""

from __future__ import annotations

from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action, filled
from albot_agents.scripted.senses import SENSED, make_sense
from albot_core.planning.percept import Percept
from albot_core.planning.steering import Command
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import ObservationConfig


@runtime_checkable
class Driver(Protocol):
    """Gives commands; what it goes by is its own matter."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin anew."""


Drives = TypeVar("Drives", bound=Driver)


class DrivingAgent(Generic[Drives]):
    """Lets a driver drive.

    Args:
        observing: How the environment makes observations.
        driver: Who drives.

    Raises:
        InputError: Observations lack something that is sensed.
    """

    name: ClassVar[str]
    knows_truth: ClassVar[bool] = False

    def __init__(self, observing: ObservationConfig, driver: Drives) -> None:
        observing.require(SENSED, self.name)
        self._observing = observing
        self._driver = driver

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        self._driver.reset(rng)
        self._actions = actions

    def _sense(self, observation: Any) -> Percept:
        """What is sensed, by an observation."""
        return make_sense(observation, self._observing)

    def _drive(self, command: Command) -> Action:
        """The action that is this command, and declares nothing."""
        return filled(ActionConfig().shares(command), self._actions)

    def _declare(self) -> Action:
        """The action that stops and declares home."""
        return filled(np.zeros(2, np.float32), self._actions, declares=True)
