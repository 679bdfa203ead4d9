"""The base of scripted agents that drive: decode observations, turn commands into actions.

A scripted agent gets the same observations as a learned one, scaled to [-1, 1]. The `decode_…`
functions undo the scaling for the planners of `albot_core.planning`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from gymnasium.spaces import Space

from albot_agents.agent import Action, Commands, EnvironmentConfigs
from albot_core.geometry.types import Points, Pose, Ranges
from albot_core.planning.navigator import KnownWay
from albot_core.planning.percept import Percept
from albot_core.planning.steering import Command
from albot_env.tasks.core.observation import ObservationConfig

SENSED_PARTS = ("laser", "motion", "heading", "home")
"""The parts of an observation that `decode_observation` decodes."""


@runtime_checkable
class Driver(Protocol):
    """A planner of `albot_core.planning` that returns drive commands."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a new episode."""


DriverT = TypeVar("DriverT", bound=Driver)


class DrivingAgent(Generic[DriverT]):
    """An agent that executes the commands of a planner.

    Args:
        configs: The environment's configurations of observations and actions.
        driver: The planner.
        claims: Whether the third number of an action claims to know the place, which the agent
            does where the mapper recognises it. Otherwise that number declares home.

    Raises:
        InputError: Observations lack one of `SENSED_PARTS`.
    """

    name: ClassVar[str]
    knows_truth: ClassVar[bool] = False

    def __init__(
        self, configs: EnvironmentConfigs, driver: DriverT, *, claims: bool = False
    ) -> None:
        configs.observations.require(SENSED_PARTS, self.name)
        self._observation_config = configs.observations
        self._commands = Commands(configs.actions)
        self._driver = driver
        self._claims = claims

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode.

        Raises:
            InputError: The actions are not those of the environment's action config.
        """
        self._driver.reset(rng)
        self._commands.reset(actions, self.name)

    def _decode(self, observation: Any) -> Percept:
        """Return the sensor readings in an observation."""
        return decode_observation(observation, self._observation_config)

    def _drive(self, command: Command, observation: Any) -> Action | np.int64:
        """Return the action for a command, with the claim to know the place if `claims` is set."""
        knows = self._claims and decode_recognition(observation, self._observation_config)
        return self._commands.action(command, flag=knows)

    def _declare(self) -> Action | np.int64:
        """Return the action that stops, and declares home unless `claims` is set."""
        return self._commands.action(np.zeros(2), flag=not self._claims)


def decode_observation(observation: Any, config: ObservationConfig) -> Percept:
    """Return an observation's readings in SI units; it is a flat array or a dict of parts."""
    assert config.laser is not None, "a robot without a laser shows no part of that name"
    parts = observation if isinstance(observation, dict) else config.split(observation)
    heading = math.atan2(parts["heading"][1], parts["heading"][0])
    cos, sin = np.cos(heading), np.sin(heading)
    home_x, home_y = decode_home(observation, config)
    return Percept(
        ranges=config.ranges(parts["laser"]),
        laser=config.laser,
        # Home is the map's origin, so the robot is at minus the rotated home vector.
        pose=np.array((sin * home_y - cos * home_x, -sin * home_x - cos * home_y, heading)),
        motion=decode_motion(observation, config),
    )


def decode_motion(observation: Any, config: ObservationConfig) -> Pose:
    """Return the robot's motion in the last step, by its odometer (m, m, rad)."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    step = np.array((config.step_length, config.step_length, config.step_turn))
    return np.asarray(parts["motion"] * step)


def decode_home(observation: Any, config: ObservationConfig) -> Points:
    """Return the estimated position of home (m, robot's frame)."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    distance = config.home_distance(parts["home"][2])
    return np.asarray(distance * np.asarray(parts["home"][:2], np.float64))


def decode_sonar(observation: Any, config: ObservationConfig) -> Ranges:
    """Return the sonar ranges (m); the maximum range where there is no echo."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return config.echoes(parts["sonar"])


def decode_has_exit(observation: Any, config: ObservationConfig) -> bool:
    """Return whether the mapper knows an exit between the current place and home."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return bool(parts["exit"][5] > 0)


def decode_recognition(observation: Any, config: ObservationConfig) -> bool:
    """Return whether the mapper recognises the current place; false if that is not observed."""
    if "place" not in config.shapes:
        return False
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return bool(parts["place"][0] > 0)


def decode_time_left(observation: Any, config: ObservationConfig) -> float:
    """Return the time left in the episode (s)."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return config.time_left(parts["time_left"][0])


def decode_travel_home(observation: Any, config: ObservationConfig) -> float:
    """Return the travelled length on which the estimate of home is based (m)."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return config.travel_home(parts["confidence"][0])


def decode_known_way(observation: Any, config: ObservationConfig) -> KnownWay | None:
    """Return the way home in the map; None if there is none, or it is not observed.

    Its length comes from the part `confidence`; without that part it is infinite.
    """
    if "way" not in config.shapes:
        return None
    parts = observation if isinstance(observation, dict) else config.split(observation)
    part = np.asarray(parts["way"], float)
    if part[3] <= 0:
        return None
    shows_length = "confidence" in config.shapes
    length = decode_travel_home(observation, config) if shows_length else np.inf
    return KnownWay(config.home_distance(part[2]) * part[:2], length)
