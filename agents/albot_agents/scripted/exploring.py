"""Agents that explore: to gaps, to frontiers, out and home again in time, and at random."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete

from albot_agents.agent import Action
from albot_agents.scripted.driving import (
    DrivingAgent,
    decode_time_left,
    decode_travel_home,
)
from albot_agents.scripted.homing import Albot1Homing
from albot_core.planning.frontier_explorer import FrontierExplorer
from albot_core.planning.gap_explorer import GapExplorer, GapExplorerConfig
from albot_core.planning.minimal_space_explorer import MinimalSpaceExplorer
from albot_env.tasks.core.observation import ObservationConfig


class GapExplorerAgent(DrivingAgent[GapExplorer]):
    """Goes from gap to gap, near ones with much new ground first.

    Args:
        observing: How the environment makes observations.
        claims: Whether it claims to know a place where its mapper recognises it.
    """

    name: ClassVar[str] = "gap-explorer"

    _GAIN: ClassVar[float] = 4.0
    """Way (m) that ground all new is worth (see `GapExplorerConfig.gain`)."""

    def __init__(self, observing: ObservationConfig, *, claims: bool = False) -> None:
        config = GapExplorerConfig(near=observing.coverage.radius, gain=self._GAIN)
        super().__init__(observing, GapExplorer(config), claims=claims)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class AssociationExplorer(DrivingAgent[MinimalSpaceExplorer]):
    """Goes to a near gap of the space about it, no farther than 3 m or 30° at a time.

    The explorer of Yeap and others, Autonomous robot mapping by landmark association (2015), to the
    letter. It keeps nothing in mind, and covers less ground than the others.

    Args:
        observing: How the environment makes observations.
        claims: Whether it claims to know a place where its mapper recognises it.
    """

    name: ClassVar[str] = "association-explorer"

    def __init__(self, observing: ObservationConfig, *, claims: bool = False) -> None:
        super().__init__(observing, MinimalSpaceExplorer(), claims=claims)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class NearestFrontier(DrivingAgent[FrontierExplorer]):
    """Goes to the nearest border of the ground that it has covered.

    Args:
        observing: How the environment makes observations.
        claims: Whether it claims to know a place where its mapper recognises it.
    """

    name: ClassVar[str] = "nearest-frontier"

    def __init__(self, observing: ObservationConfig, *, claims: bool = False) -> None:
        super().__init__(observing, FrontierExplorer(observing.coverage.radius), claims=claims)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class RoundTripAgent:
    """Explores as the gap explorer does, and drives home as `albot1-homing` before time is up.

    How long the way home is it takes from the confidence that the mapper has in it, which falls
    with its length.

    Args:
        observing: How the environment makes observations.
    """

    name: ClassVar[str] = "round-trip"
    knows_truth: ClassVar[bool] = False

    SPEED = 0.35
    """The speed that it expects of its way home (m/s)…"""
    SPARE = 15.0
    """…and the time that it keeps in reserve (s)."""

    def __init__(self, observing: ObservationConfig) -> None:
        self._observing = observing
        self._explorer = GapExplorerAgent(observing)
        self._homer = Albot1Homing(observing)

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew: explore.

        Raises:
            InputError: The environment shows no time left, or no confidence.
        """
        self._observing.require(("time_left", "confidence"), self.name)
        self._explorer.reset(rng, actions)
        self._homer.reset(rng, actions)
        self._returns = False

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The next action."""
        left = decode_time_left(observation, self._observing)
        travel = decode_travel_home(observation, self._observing)
        self._returns |= left < self.SPARE + travel / self.SPEED
        return (self._homer if self._returns else self._explorer).act(observation, info)


class RandomAgent:
    """Draws an action at random and keeps to it for a second; an answer, each time anew."""

    name: ClassVar[str] = "random"
    knows_truth: ClassVar[bool] = False

    _HOLD = 10
    """Steps for which an action is kept: white noise would only tremble on the spot."""

    def reset(self, rng: np.random.Generator, actions: Box | Discrete) -> None:
        """Begin anew."""
        self._rng = rng
        self._choices = int(actions.n) if isinstance(actions, Discrete) else 0
        self._shape = actions.shape
        self._left = 0

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """An action that does not depend on the observation."""
        if self._choices:
            return np.int64(self._rng.integers(self._choices))
        if self._left == 0:
            self._action = self._rng.uniform(-1, 1, self._shape).astype(np.float32)
            self._left = self._HOLD
        self._left -= 1
        return self._action.copy()
