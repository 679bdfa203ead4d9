"""Agents that drive home: by the map, by the odometer alone, and by the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action, fill_action
from albot_agents.scripted.driving import (
    DrivingAgent,
    decode_has_exit,
    decode_home,
    decode_known_way,
    decode_motion,
    decode_sonar,
)
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.geometry.types import Pose
from albot_core.planning.navigator import GoalSeeker, Navigator
from albot_core.planning.sonar_driver import SonarDriver
from albot_env.tasks.core.actions import ActionConfig
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

    name: ClassVar[str] = "map-homing"

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


class Albot0Homing:
    """Drives back along Albot0's way out, by sonars alone, until it believes to be in the home ASR.

    Schmidt, Wong and Yeap: straight on until an obstacle, then round it; "the return journey
    stopped when the robot believed that it reached home, or, more precisely, the ASR that contains
    the start location". Before it declares that it is home it goes on to where that ASR began,
    which is ours: home is a place, and an ASR may be long.

    Args:
        observing: How the environment makes observations. Where they do not show whether there is
            an exit before home (the part `exit`), the place where home is believed to be is all
            that it goes by; where not the way home (`way`), it makes straight for that.

    Raises:
        InputError: Observations lack one of the parts that it needs.
    """

    name: ClassVar[str] = "albot0-homing"
    knows_truth: ClassVar[bool] = False

    ARRIVED = 0.3
    """How near to where it believes home to be it declares (m)…"""
    PATIENCE = 600
    """…or after so many steps in the home ASR."""

    def __init__(self, observing: ObservationConfig) -> None:
        observing.require(("sonar", "motion", "home"), self.name)
        assert observing.sonar is not None, "shown by the part of that name"
        self._observing = observing
        self._sonar = observing.sonar
        self._driver = SonarDriver()

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin anew."""
        self._driver.reset(rng)
        self._actions = actions
        self._steps_at_home = 0

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """The action that leads on towards home, or declares it."""
        observing = self._observing
        home = decode_home(observation, observing)
        knows_asr = "exit" in observing.shapes
        believes_home = knows_asr and not decode_has_exit(observation, observing)
        self._steps_at_home += believes_home
        is_there = (believes_home or not knows_asr) and np.hypot(*home) < self.ARRIVED
        if is_there or self._steps_at_home > self.PATIENCE:
            return fill_action(np.zeros(2, np.float32), self._actions, says=True)
        known = decode_known_way(observation, observing)
        ahead = home if known is None else known.ahead
        # Where the way is at its end, and the home ASR is not, on it goes.
        target = ahead if np.hypot(*ahead) >= self.ARRIVED else None
        ranges, motion = decode_sonar(observation, observing), decode_motion(observation, observing)
        command = self._driver.command(ranges, self._sonar, motion, target)
        return fill_action(ActionConfig().shares(command), self._actions)


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
