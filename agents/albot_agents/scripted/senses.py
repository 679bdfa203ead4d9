"""What a scripted agent makes of an observation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from albot_core.planning.navigator import KnownWay
from albot_core.planning.percept import Percept
from albot_env.tasks.core.observation import ObservationConfig

SENSED = ("laser", "motion", "heading", "home")
"""The parts of an observation that `make_sense` makes sense of."""


def make_sense(observation: Any, config: ObservationConfig) -> Percept:
    """Undo the scaling of an observation, flat or by part."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    heading = math.atan2(parts["heading"][1], parts["heading"][0])
    cos, sin = np.cos(heading), np.sin(heading)
    distance = config.home_distance(parts["home"][2])
    home_x, home_y = distance * parts["home"][0], distance * parts["home"][1]
    step = np.array((config.step_length, config.step_length, config.step_turn))
    return Percept(
        ranges=config.ranges(parts["laser"]),
        laser=config.laser,
        # Home is the map's origin, so the robot is at minus the turned home vector.
        pose=np.array((sin * home_y - cos * home_x, -sin * home_x - cos * home_y, heading)),
        motion=parts["motion"] * step,
    )


def sense_time_left(observation: Any, config: ObservationConfig) -> float:
    """The time left (s)."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return config.time_left(parts["time_left"][0])


def sense_travel_home(observation: Any, config: ObservationConfig) -> float:
    """The length of the travel that the belief of home rests on (m)."""
    parts = observation if isinstance(observation, dict) else config.split(observation)
    return config.travel_home(parts["confidence"][0])


def sense_known_way(observation: Any, config: ObservationConfig) -> KnownWay | None:
    """The way home that the map holds; None for none, or where it is not shown.

    Where no confidence is shown, which tells its length, it is infinitely long.
    """
    if "way" not in config.shapes:
        return None
    parts = observation if isinstance(observation, dict) else config.split(observation)
    part = np.asarray(parts["way"], float)
    if part[3] <= 0:
        return None
    shows_length = "confidence" in config.shapes
    length = sense_travel_home(observation, config) if shows_length else np.inf
    return KnownWay(config.home_distance(part[2]) * part[:2], length)
