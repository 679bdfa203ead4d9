"""Agents that explore: by gaps, by frontiers, with a return in time, and at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Discrete, Space

from albot_agents.agent import Action, EnvironmentConfigs
from albot_agents.scripted.driving import SENSED_PARTS, DrivingAgent, steering_for
from albot_agents.scripted.followers import OnwardFollower
from albot_agents.scripted.homing import Albot1Homing
from albot_agents.scripted.patch_homing import PatchHoming
from albot_core.planning.frontier_explorer import FrontierExplorer
from albot_core.planning.gap_explorer import GapExplorer, GapExplorerConfig
from albot_core.planning.minimal_space_explorer import MinimalSpaceConfig, MinimalSpaceExplorer
from albot_core.planning.route_explorer import RouteExplorer, RouteExplorerConfig
from albot_env.tasks.core.observation import PART_NAMES, ObservationConfig
from albot_env.tasks.core.parts.beliefs import CONFIDENCE, HOME, TIME_LEFT
from albot_env.tasks.core.parts.map_patch import MAP_PATCH

_ROUND_TRIP_PARTS = (
    *OnwardFollower.OBSERVATIONS.parts,
    *SENSED_PARTS,
    CONFIDENCE.name,
    MAP_PATCH.name,
    TIME_LEFT.name,
)


class GapExplorerAgent(DrivingAgent[GapExplorer]):
    """Explores from gap to gap; near gaps with much new ground come first.

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "gap-explorer"

    _GAIN: ClassVar[float] = 4.0
    """Driving distance (m) that completely new ground is worth (see `GapExplorerConfig.gain`)."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        config = GapExplorerConfig(
            coverage_range=configs.observations.coverage.radius,
            gain=self._GAIN,
            steering=steering_for(configs),
        )
        super().__init__(configs, GapExplorer(config))

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class AssociationExplorer(DrivingAgent[MinimalSpaceExplorer]):
    """Explores by moves of at most 3 m or 30° to a nearby gap of the surrounding space.

    The explorer of Yeap and others, Autonomous robot mapping by landmark association (2015), but
    for the gaps, which are jumps of the laser's range, and for swerving round obstacles. It has no
    memory, and covers less ground than the other explorers.

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "association-explorer"

    def __init__(self, configs: EnvironmentConfigs) -> None:
        config = MinimalSpaceConfig(steering=steering_for(configs))
        super().__init__(configs, MinimalSpaceExplorer(config))

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class NearestFrontier(DrivingAgent[FrontierExplorer]):
    """Explores by driving to the nearest frontier of the covered ground.

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "nearest-frontier"

    def __init__(self, configs: EnvironmentConfigs) -> None:
        driver = FrontierExplorer(configs.observations.coverage.radius, steering_for(configs))
        super().__init__(configs, driver)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class RatSlamExplorer(DrivingAgent[RouteExplorer]):
    """Explores by taking each route that it sees, in narrow places in both directions.

    The robot of Milford, Prasser and Wyeth 2005 attempts to learn all the possible routes, and is
    to turn round in long narrow environments (sections 6 and 7); how is ours (`RouteExplorer`).

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "ratslam-explorer"

    def __init__(self, configs: EnvironmentConfigs) -> None:
        config = RouteExplorerConfig(steering=steering_for(configs))
        super().__init__(configs, RouteExplorer(config))

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action."""
        return self._drive(self._driver.command(self._decode(observation)), observation)


class TimeToReturn:
    """Tells when a robot must drive home, so as to be there before its time is up.

    It takes the length of the way home from the mapper's confidence, which falls with that length;
    where that is not observed, from the distance of home on a straight line.

    Args:
        config: The environment's observation config.
        speed: Expected speed on the way home (m/s).
    """

    SPARE = 15.0
    """Time kept in reserve (s)."""
    WINDING = 2.0
    """Expected length of the way home, divided by the distance on a straight line."""

    def __init__(self, config: ObservationConfig, speed: float) -> None:
        self._config, self._speed = config, speed

    def reset(self, who: str) -> None:
        """Begin a new episode of this agent.

        Raises:
            InputError: Observations lack the part `time_left`.
        """
        self._config.require((TIME_LEFT.name,), who)
        self._has_come = False

    def has_come(self, observation: Any) -> bool:
        """Return whether it is time to drive home; once it is, it remains so."""
        left = self._config.decode(TIME_LEFT, observation)
        if self._config.observes(CONFIDENCE):
            travel = self._config.decode(CONFIDENCE, observation)
        else:
            home = self._config.decode(HOME, observation)
            travel = self.WINDING * float(np.hypot(*home))
        self._has_come |= left < self.SPARE + travel / self._speed
        return self._has_come


class RoundTripAgent:
    """Explores like `gap-explorer`, and drives home like `albot1-homing` before time is up.

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "round-trip"
    knows_truth: ClassVar[bool] = False
    EXPLORER: ClassVar[type[GapExplorerAgent | OnwardFollower]] = GapExplorerAgent
    """The agent that explores."""
    HOMER: ClassVar[type[Albot1Homing | PatchHoming]] = Albot1Homing
    """The agent that drives home."""

    SPEED = 0.35
    """Expected speed on the way home (m/s)."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        self._return = TimeToReturn(configs.observations, self.SPEED)
        self._explorer = self.EXPLORER(configs)
        self._homer = self.HOMER(configs)

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode, exploring.

        Raises:
            InputError: Observations lack the part `time_left`.
        """
        self._return.reset(self.name)
        self._explorer.reset(rng, actions)
        self._homer.reset(rng, actions)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action."""
        its = self._homer if self._return.has_come(observation) else self._explorer
        return its.act(observation, info)


class OnwardRoundTrip(RoundTripAgent):
    """Explores like `onward-follower`, by the planner's hint, and drives home like `patch-homing`.

    Nearly all that it does depends on the present observation alone, so a policy can learn to act
    like it.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack a part that `onward-follower` or `patch-homing` needs.
    """

    name: ClassVar[str] = "onward-round-trip"
    EXPLORER: ClassVar[type[GapExplorerAgent | OnwardFollower]] = OnwardFollower
    HOMER: ClassVar[type[Albot1Homing | PatchHoming]] = PatchHoming

    OBSERVATIONS: ClassVar[ObservationConfig] = replace(
        OnwardFollower.OBSERVATIONS,
        parts=tuple(part for part in PART_NAMES if part in _ROUND_TRIP_PARTS),
    )
    """What it observes if nothing else is asked for: the map too, and the time left."""


class RandomAgent:
    """Draws a random action and holds it for a second; draws a discrete action at every step."""

    name: ClassVar[str] = "random"
    knows_truth: ClassVar[bool] = False

    _HOLD = 10
    """Steps for which an action is held; white noise would only jitter on the spot."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        """The agent looks at nothing, so that any environment suits it."""

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode."""
        self._rng = rng
        self._choices = int(actions.n) if isinstance(actions, Discrete) else 0
        self._shape = actions.shape
        self._left = 0

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return an action that does not depend on the observation."""
        if self._choices:
            return np.int64(self._rng.integers(self._choices))
        if self._left == 0:
            self._action = self._rng.uniform(-1, 1, self._shape).astype(np.float32)
            self._left = self._HOLD
        self._left -= 1
        return self._action.copy()
