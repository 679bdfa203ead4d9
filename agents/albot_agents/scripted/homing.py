"""Agents that drive home: by the map, by odometry alone, and by the ground truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Space

from albot_agents.agent import Action, Commands, EnvironmentConfigs
from albot_agents.scripted.driving import (
    DrivingAgent,
    decode_known_way,
    steering_for,
)
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.geometry.types import Points, Pose
from albot_core.planning.navigator import GoalSeeker, Navigator
from albot_core.planning.percept import Percept
from albot_core.planning.sonar_driver import SonarDriver
from albot_core.planning.steering import Command, admissible_command
from albot_env.tasks.core.parts.beliefs import EXIT_HOME, HOME
from albot_env.tasks.core.parts.sensors import MOTION, SONAR


class MapHoming(DrivingAgent[Navigator]):
    """Drives home by the way that its mapper knows, with any mapper.

    It uses only what the map holds (`RouteHome`). If the known way is much longer than a way that
    it has not seen blocked, it tries the latter; this is our addition. It avoids obstacles by its
    laser.

    Args:
        configs: The environment's configurations of observations and actions. Without the part
            `way`, the agent heads straight for home.
    """

    name: ClassVar[str] = "map-homing"

    ARRIVED = 0.3
    """Distance to the estimated home at which it declares home (m)."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        super().__init__(configs, Navigator(steering_for(configs)))

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        percept = self._decode(observation)
        home = inverse(percept.pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        known = decode_known_way(observation, self._observation_config)
        return self._drive(self._driver.command(percept, home, known), observation)


class Albot1Homing(MapHoming):
    """Drives home through Albot1's network of places: back through its exits, place by place.

    Through the network it returns to the place where it started (Hossain 2014, section 4.2.3,
    brings known places into the perceptual map one at a time). Within a place it follows the trail
    by which it came.
    """

    name: ClassVar[str] = "albot1-homing"


class AssociationHoming(MapHoming):
    """Heads for home by the global map of landmark association, and avoids what it sees.

    Yeap and others (2015) do not say how their robot would drive home, only that it would
    recognise landmarks in the global map. Its position in that map gives the direction of home.
    """

    name: ClassVar[str] = "association-homing"


class RatSlamHoming(MapHoming):
    """Drives home over RatSLAM's experience map, by the quickest route of transitions.

    Milford, Prasser and Wyeth 2005 name this as the use of the transitions' times (section 7).
    """

    name: ClassVar[str] = "ratslam-homing"


class Albot0Homing:
    """Drives back along Albot0's outward path by sonars alone, into the estimated home ASR.

    Schmidt, Wong and Yeap: straight on until an obstacle, then round it; "the return journey
    stopped when the robot believed that it reached home, or, more precisely, the ASR that contains
    the start location". Here the robot drives on to the beginning of that ASR before it declares
    home. This is our addition: home is a position, and an ASR may be long.

    Args:
        configs: The environment's configurations of observations and actions. Without the part
            `exit` (is there an exit before home?), only the estimated position of home counts;
            without the part `way`, the agent heads straight for that position.

    Raises:
        InputError: Observations lack one of the parts that it needs.
    """

    name: ClassVar[str] = "albot0-homing"
    knows_truth: ClassVar[bool] = False

    ARRIVED = 0.3
    """Distance to the estimated home at which it declares home (m)."""
    PASSED = 0.2
    """It also declares home where it comes no nearer: so much (m) farther away than it was, in the
    home ASR and at the end of the known way. The estimate may lie beyond a wall."""
    STALL_STEPS = 600
    """Number of steps in the home ASR after which it declares home anyway."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        observation_config = configs.observations
        observation_config.require(("sonar", "motion", "home"), self.name)
        assert observation_config.sonar is not None, "shown by the part of that name"
        self._observation_config = observation_config
        self._sonar = observation_config.sonar
        self._driver = SonarDriver(robot=configs.robot)
        self._commands = Commands(configs.actions)

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode."""
        self._driver.reset(rng)
        self._commands.reset(actions, self.name)
        self._steps_at_home = 0
        self._nearest = np.inf

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        config = self._observation_config
        home = config.decode(HOME, observation)
        knows_asr = EXIT_HOME.name in config.shapes
        believes_home = knows_asr and config.decode(EXIT_HOME, observation) is None
        known = decode_known_way(observation, config)
        self._steps_at_home += believes_home
        distance = float(np.hypot(*home))
        is_there = (believes_home or not knows_asr) and distance < self.ARRIVED
        is_at_end = believes_home and known is None
        self._nearest = min(self._nearest, distance) if is_at_end else np.inf
        has_passed = distance > self._nearest + self.PASSED
        if is_there or has_passed or self._steps_at_home > self.STALL_STEPS:
            return self._commands.action(np.zeros(2), says="declare")
        ahead = home if known is None else known.ahead
        # At the end of the known way, but not yet in the home ASR, it drives on without a target.
        target = ahead if np.hypot(*ahead) >= self.ARRIVED else None
        ranges, motion = (config.decode(part, observation) for part in (SONAR, MOTION))
        command = self._driver.command(ranges, self._sonar, motion, target)
        return self._commands.action(command)


class PathIntegration(DrivingAgent[GoalSeeker]):
    """Follows the odometer's home vector around obstacles, and declares home where it vanishes.

    It takes the position of home from the first observation, and afterwards integrates odometry
    alone. With the mapper `none`, the first estimate is the odometry of the outward journey, so no
    map is involved.

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "path-integration"

    ARRIVED = 0.2
    """Length of the home vector below which it declares home (m)."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        super().__init__(configs, GoalSeeker(steering_for(configs)))

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode."""
        super().reset(rng, actions)
        self._pose: Pose | None = None

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        percept = self._decode(observation)
        self._pose = percept.pose if self._pose is None else compose(self._pose, percept.motion)
        home = inverse(self._pose)[:2]
        if np.hypot(*home) < self.ARRIVED:
            return self._declare()
        return self._drive(self._driver.command(percept, home), observation)


class Oracle(DrivingAgent[GoalSeeker]):
    """The upper bound: knows the ground truth, but still has to drive.

    It takes from `info` the robot's pose (`pose`), its start (`start`), the next turning point of
    the shortest path home (`next_turn_home`) and that path's length (`distance_home`). It turns on
    the spot towards the turning point and drives there straight, as slowly as the robot's
    acceleration demands. Where something holds it up, it pushes on, and then drives around it by
    its laser.

    Args:
        configs: The environment's configurations of observations and actions.
    """

    name: ClassVar[str] = "oracle"
    knows_truth: ClassVar[bool] = True

    ARRIVED = 0.2
    """Distance to home at which it stops (m)."""
    CLEARANCE = 0.05
    """Distance of its body from walls (m) at which it passes turning points."""
    TURN_FIRST = 0.2
    """Angle to the turning point above which it turns on the spot (rad)."""
    BRAKING = 0.8
    """Deceleration towards a turning point (m/s²); the wheels can brake with 1 m/s²."""
    SLOWEST = 0.15
    """Speed at a turning point (m/s)."""
    GAIN = 4.0
    """Turn rate per radian between heading and turning point (1/s)."""
    CAREFUL_STEPS, PUSHING_STEPS, DETOUR_STEPS = 30, 60, 60
    """Number of steps without progress for which it brakes before obstacles; then drives on
    although it may touch them; and then drives around them by its laser."""
    NEARER = 0.1
    """Least decrease of the way home that counts as progress (m)."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        self._steering = steering_for(configs)
        super().__init__(configs, GoalSeeker(self._steering))

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode."""
        super().reset(rng, actions)
        self._nearest = np.inf
        self._steps_without_progress = 0

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on along the shortest path, or declares home."""
        pose, home = info["pose"], info["start"][:2]
        distance = float(np.hypot(*(home - pose[:2])))
        if distance < self.ARRIVED:
            return self._declare()
        turn = transform_points(inverse(pose), info["next_turn_home"])
        percept = self._decode(observation)
        steps = self._count_steps(info["distance_home"])
        if steps > self.CAREFUL_STEPS + self.PUSHING_STEPS:
            return self._drive(self._driver.command(percept, turn), observation)
        command = self._straight(self._beside_walls(turn, percept))
        if steps <= self.CAREFUL_STEPS:
            command = admissible_command(command, percept.points, percept.motion, self._steering)
        return self._drive(command, observation)

    def _beside_walls(self, turn: Points, percept: Percept) -> Points:
        """Return the turning point, which may touch a wall, moved away from what the laser sees."""
        apart = turn - percept.points
        distances = np.hypot(*apart.T)
        nearest = int(np.argmin(distances))
        lacking = self._steering.robot.radius + self.CLEARANCE - distances[nearest]
        if lacking <= 0 or distances[nearest] == 0:
            return turn
        return np.asarray(turn + lacking * apart[nearest] / distances[nearest])

    def _straight(self, turn: Points) -> Command:
        """Return the command that drives straight to a turning point (m, robot's frame)."""
        bearing, distance = float(np.arctan2(turn[1], turn[0])), float(np.hypot(*turn))
        speed = 0.0
        if abs(bearing) < self.TURN_FIRST:
            speed = max(self.SLOWEST, np.sqrt(2 * self.BRAKING * distance) - self.BRAKING * 0.1)
        return np.array((speed, self.GAIN * bearing))

    def _count_steps(self, way_home: float) -> int:
        """Update with the length of the way home (m); return the steps without progress."""
        self._steps_without_progress += 1
        longest = self.CAREFUL_STEPS + self.PUSHING_STEPS + self.DETOUR_STEPS
        if way_home < self._nearest - self.NEARER or self._steps_without_progress > longest:
            self._nearest, self._steps_without_progress = way_home, 0
        return self._steps_without_progress
