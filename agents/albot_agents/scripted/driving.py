"""The base of scripted agents that drive: decode observations, turn commands into actions.

A scripted agent gets the same observations as a learned one, scaled to [-1, 1]. The planners of
`albot_core.planning` get what they stand for.
"""

from __future__ import annotations

from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from gymnasium.spaces import Space

from albot_agents.agent import Action, Commands, EnvironmentConfigs
from albot_core.planning.navigator import KnownWay
from albot_core.planning.percept import Percept
from albot_core.planning.steering import Command, SteeringConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.beliefs import CONFIDENCE, HEADING, HOME, PLACE, WAY
from albot_env.tasks.core.parts.matches import MATCHES
from albot_env.tasks.core.parts.sensors import LASER, MOTION

SENSED_PARTS = tuple(part.name for part in (LASER, MOTION, HEADING, HOME))
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

    Raises:
        InputError: Observations lack one of `SENSED_PARTS`.
    """

    name: ClassVar[str]
    knows_truth: ClassVar[bool] = False

    def __init__(self, configs: EnvironmentConfigs, driver: DriverT) -> None:
        configs.observations.require(SENSED_PARTS, self.name)
        self._observation_config = configs.observations
        self._commands = Commands(configs.actions)
        self._driver = driver

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
        """Return the action for a command, with the claim to know the place where it is known."""
        knows = decode_recognition(observation, self._observation_config)
        return self._commands.action(command, says="claim" if knows else "")

    def _declare(self) -> Action | np.int64:
        """Return the action that stops, and declares home."""
        return self._commands.action(np.zeros(2), says="declare")


def steering_for(configs: EnvironmentConfigs) -> SteeringConfig:
    """Return the steering parameters for the robot of an environment."""
    return SteeringConfig(robot=configs.robot)


def decode_observation(observation: Any, config: ObservationConfig) -> Percept:
    """Return an observation's readings in SI units; it is a flat array or a dict of parts."""
    assert config.laser is not None, "a robot without a laser shows no part of that name"
    heading = config.decode(HEADING, observation)
    cos, sin = np.cos(heading), np.sin(heading)
    home_x, home_y = config.decode(HOME, observation)
    return Percept(
        ranges=config.decode(LASER, observation),
        laser=config.laser,
        # Home is the map's origin, so the robot is at minus the rotated home vector.
        pose=np.array((sin * home_y - cos * home_x, -sin * home_x - cos * home_y, heading)),
        motion=config.decode(MOTION, observation),
    )


CLAIM_SCORE, CLAIM_DISTANCE = 0.4, 1.0
"""An agent claims to know a place if its best match has at least this score, and was taken no
farther away than this (m)."""


def decode_recognition(observation: Any, config: ObservationConfig) -> bool:
    """Return whether to claim that the place is known.

    If matches are observed, the best must score well, be near, and be more probable than any other
    place. Otherwise the mapper's own word counts, if that is observed.
    """
    if MATCHES.name in config.shapes:
        matches = config.decode(MATCHES, observation)
        return bool(
            len(matches.scores)
            and matches.scores[0] >= CLAIM_SCORE
            and np.hypot(*matches.points[0]) <= CLAIM_DISTANCE
            and matches.probabilities[0] > matches.ambiguities[0]
        )
    return PLACE.name in config.shapes and config.decode(PLACE, observation).is_recognised


def decode_known_way(observation: Any, config: ObservationConfig) -> KnownWay | None:
    """Return the way home in the map; None if there is none, or it is not observed.

    Its length comes from the part `confidence`; without that part it is infinite.
    """
    ahead = config.decode(WAY, observation) if WAY.name in config.shapes else None
    if ahead is None:
        return None
    shows_length = CONFIDENCE.name in config.shapes
    return KnownWay(ahead, config.decode(CONFIDENCE, observation) if shows_length else np.inf)
