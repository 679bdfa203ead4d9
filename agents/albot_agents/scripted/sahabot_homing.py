"""The agent that comes home as Sahabot 2 and the desert ant do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Space

from albot_agents.agent import Action, EnvironmentConfigs
from albot_agents.scripted.driving import (
    DrivingAgent,
    decode_known_way,
    decode_recognition,
    steering_for,
)
from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Points
from albot_core.planning.navigator import GoalSeeker
from albot_core.planning.systematic_search import SearchConfig, SystematicSearch


class SahabotHoming(DrivingAgent[GoalSeeker]):
    """Comes home by the ant's three strategies, one after another (thesis, section 2.3.1).

    Path integration: it drives along the home vector, around obstacles. Landmarks: as soon as its
    mapper tells a way by them (the part `way`), it goes there. Systematic search: where the home
    vector ends and no landmark tells the way, it goes in loops of growing size around that place,
    until one does. It declares home where its mapper recognises the nest (the part `place`); if the
    search brings nothing, where the home vector ends.

    Args:
        configs: The environment's configurations of observations and actions. Without the part
            `way` there are no landmarks; without `place` it searches in vain.
    """

    name: ClassVar[str] = "sahabot-homing"

    ARRIVED = 0.25
    """Length of the home vector below which it ends (m)."""
    AT_NEST = 0.5
    """Length of the home vector up to which a recognised place is the nest (m)."""
    PATIENCE = 200
    """Number of steps by landmarks after which it searches instead: they lead nowhere."""
    STALL = 40
    """Number of steps after which a point of the search counts as out of reach."""

    SEARCH = SearchConfig(largest=2.5, loops=4)
    """The loops of its search: in a building walls bar longer ones, and the compass leads nearer to
    home than they would."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        super().__init__(configs, GoalSeeker(steering_for(configs)))
        self._search = SystematicSearch(self.SEARCH)

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode."""
        search, drive = rng.spawn(2)
        super().reset(drive, actions)
        self._search.begin(search)
        self._is_searching = False
        self._steps_by_landmarks = self._steps_to_point = 0
        self._point = np.zeros(2)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action that drives on towards home, or declares home."""
        percept = self._decode(observation)
        home = inverse(percept.pose)[:2]
        distance = float(np.hypot(*home))
        if decode_recognition(observation, self._observation_config) and distance < self.AT_NEST:
            return self._declare()
        known = decode_known_way(observation, self._observation_config)
        if known is not None and self._steps_by_landmarks < self.PATIENCE:
            self._steps_by_landmarks += 1
            return self._drive(self._driver.command(percept, known.ahead), observation)
        if not self._is_searching:
            self._is_searching = distance < self.ARRIVED
            return self._drive(self._driver.command(percept, home), observation)
        if self._search.is_over and distance < self.ARRIVED:
            return self._declare()
        target = self._search_point(percept.pose[:2])
        ahead = np.asarray(transform_points(inverse(percept.pose), target))
        return self._drive(self._driver.command(percept, ahead), observation)

    def _search_point(self, position: Points) -> Points:
        """Return the point of the search to drive to (m, map frame), past those out of reach."""
        target = self._search.target(position)
        if not np.array_equal(target, self._point):
            self._point, self._steps_to_point = target, 0
        self._steps_to_point += 1
        if self._steps_to_point > self.STALL:
            self._search.skip()
            target = self._search.target(position)
            self._point, self._steps_to_point = target, 0
        return target
