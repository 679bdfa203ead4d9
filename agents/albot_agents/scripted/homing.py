"""Agents that drive home: by the map, by the odometer alone, and by the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action
from albot_agents.scripted.driving import DrivingAgent, decode_known_way
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.geometry.types import Pose
from albot_core.planning.navigator import GoalSeeker, Navigator
from albot_env.tasks.core.observation import ObservationConfig


class MapHoming(DrivingAgent[Navigator]):
    """Drives home by the way that its mapper knows, whichever mapper that is.

    It uses only what the map holds (`RouteHome`). Where the known way is much longer than one
    that it has not seen to be barred, it tries the latter; that is ours. Round what is in the way
    it goes by its laser.

    Args:
        observing: How the environment makes observations. Where they do not show the way home
            (the part `way`), it makes straight for home.
        claims: Whether it claims to know a place where its mapper recognises it.
    """

    ARRIVED = 0.3
    """How near to where it believes home to be it declares (m)."""

    def __init__(self, observing: ObservationConfig, *, claims: bool = False) -> None:
        super().__init__(observing, Navigator(), claims=claims)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        percept = self._decode(observation)
        home = inverse(percept.pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        known = decode_known_way(observation, self._observing)
        return self._drive(self._driver.command(percept, home, known), observation)


class Albot1Homing(MapHoming):
    """Drives over Albot1's network of places: back through its exits, one place at a time.

    Over the network it goes back to the place that it set out from (Hossain 2014, section 4.2.3,
    brings known places into the perceptual map one at a time), within a place by the trail that it
    came by.
    """

    name: ClassVar[str] = "albot1-homing"


class AssociationHoming(MapHoming):
    """Points home from the global map of landmark association, and plans round what it sees.

    Yeap and others (2015) do not say how their robot would go home, but that it would recognise
    landmarks in the global map: where it is in there tells where home is.
    """

    name: ClassVar[str] = "association-homing"


class RatSlamHoming(MapHoming):
    """Drives over RatSLAM's experience map, by the quickest route of transitions.

    Milford, Prasser and Wyeth 2005 name this as what the times of transitions are for (section 7).
    """

    name: ClassVar[str] = "ratslam-homing"


class PathIntegration(DrivingAgent[GoalSeeker]):
    """Follows the odometer's home vector round obstacles, and declares home where it is nothing.

    From the first observation it takes where home is believed to be, and from there on adds up
    the odometer alone. With the mapper `none` inside, what is believed first is what
    the odometer has added up on the way out: then no map is in it at all.

    Args:
        observing: How the environment makes observations.
        claims: Whether it claims to know a place where its mapper recognises it.
    """

    name: ClassVar[str] = "path-integration"

    ARRIVED = 0.2
    """The home vector is nothing where it is shorter than this (m)."""

    def __init__(self, observing: ObservationConfig, *, claims: bool = False) -> None:
        super().__init__(observing, GoalSeeker(), claims=claims)

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        super().reset(rng, actions)
        self._pose: Pose | None = None

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        percept = self._decode(observation)
        self._pose = percept.pose if self._pose is None else compose(self._pose, percept.motion)
        home = inverse(self._pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        return self._drive(self._driver.command(percept, home), observation)


class Oracle(DrivingAgent[GoalSeeker]):
    """The upper bound: knows the truth, and still has to drive.

    It takes from `info` where the robot is (`pose`), where it set out (`start`) and where the
    shortest way home turns next (`next_turn_home`); outside `Albot/Homing-v0` it heads
    straight for the start.

    Args:
        observing: How the environment makes observations.
        claims: Whether it claims to know a place where its mapper recognises it.
    """

    name: ClassVar[str] = "oracle"
    knows_truth: ClassVar[bool] = True

    ARRIVED = 0.2
    """How near to home it stops (m)."""

    def __init__(self, observing: ObservationConfig, *, claims: bool = False) -> None:
        super().__init__(observing, GoalSeeker(), claims=claims)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on along the shortest way, or declares home."""
        percept = self._decode(observation)
        pose, home = info["pose"], info["start"][:2]
        if np.hypot(*(home - pose[:2])) < self.ARRIVED:
            return self._declare()
        turn = transform_points(inverse(pose), info.get("next_turn_home", home))
        return self._drive(self._driver.command(percept, turn), observation)
