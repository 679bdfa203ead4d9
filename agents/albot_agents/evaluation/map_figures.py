"""What an episode's map was like: the error of home, and how sharp the map is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from albot_agents.agent import EnvironmentConfigs
from albot_core.geometry.poses import relative, wrap_angle
from albot_core.geometry.types import Pose
from albot_core.sensing.reading import LaserScan
from albot_env.tasks.core.parts.beliefs import HOME
from albot_env.tasks.core.parts.sensors import LASER

SPACING, TURN = 0.5, 0.5
"""Distance (m) or turn (rad) between two scans that are laid together."""
POINTS, SAMPLES = 20_000, 1000
"""Largest number of points of a map, and number of those whose neighbourhoods are measured."""


class MapFigures:
    """Follows an episode and measures its map, as far as observations show what is needed.

    - `home_error_begin` and `home_error`: distance (m) between where home is believed and where it
      is, both in the robot's frame, at the beginning and at the end: how far it would miss home.
    - `map_entropy` and `true_map_entropy`: `mean_map_entropy` (nats) of the scans where the robot
      believed that they were taken, and where they were. Only of episodes that begin with an empty
      map, because the scans of an outward journey are not shown.

    Args:
        configs: The environment's configurations of observations and actions.
        observation: The first observation.
        info: The first info.
    """

    def __init__(
        self, configs: EnvironmentConfigs, observation: Any, info: Mapping[str, Any]
    ) -> None:
        self._config = configs.observations
        shapes = self._config.shapes
        self._shows_home = HOME.name in shapes
        beams = None if self._config.laser is None else (self._config.laser.beams,)
        # Sectors are no scan.
        self._maps = shapes.get(LASER.name, ()) == beams and info["path_length"] == 0.0
        self._scans: list[LaserScan] = []
        self._believed: list[Pose] = []
        self._true: list[Pose] = []
        self._begin = self._home_error(observation, info)
        self.add(observation, info)

    def add(self, observation: Any, info: Mapping[str, Any]) -> None:
        """Take in a step; keep its scan if the robot has moved on."""
        if not self._maps or (self._true and not _has_moved(self._true[-1], info["pose"])):
            return
        assert self._config.laser is not None, "observations show its scans"
        ranges = self._config.decode(LASER, observation)
        ranges = np.where(ranges < 0.999 * self._config.laser_range, ranges, np.inf)
        self._scans.append(LaserScan(ranges=ranges, geometry=self._config.laser))
        # Copies, because a batch writes its next step into the same arrays.
        self._believed.append(info["belief"].copy())
        self._true.append(info["pose"].copy())

    def end(self, observation: Any, info: Mapping[str, Any]) -> dict[str, float]:
        """Return the figures, given the last observation and info."""
        found = {"home_error_begin": self._begin, "home_error": self._home_error(observation, info)}
        if self._maps:
            # slow to load
            from albot_core.evaluation.map_quality import mean_map_entropy, scan_cloud

            for name, poses in (("map", self._believed), ("true_map", self._true)):
                cloud = scan_cloud(self._scans, np.array(poses), POINTS)
                found[f"{name}_entropy"] = mean_map_entropy(cloud, samples=SAMPLES)
        return {name: value for name, value in found.items() if value is not None}

    def _home_error(self, observation: Any, info: Mapping[str, Any]) -> float | None:
        if not self._shows_home:
            return None
        believed = self._config.decode(HOME, observation)
        return float(np.hypot(*(believed - relative(info["pose"], info["start"])[:2])))


def _has_moved(before: Pose, now: Pose) -> bool:
    """Return whether the robot has moved or turned far enough for another scan."""
    turned = abs(float(wrap_angle(now[2] - before[2])))
    return bool(np.hypot(*(now - before)[:2]) >= SPACING or turned >= TURN)
